"""Refine many meshes at once: for scenes of thousands, where each alone would cost its overhead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, SupportsIndex

import numpy as np
from jaxtyping import Float, Int

from pns_common.arguments import (
    DEFAULT_LEVELS,
    check_limit,
    check_reference_length,
    check_scheme,
    checked_threads,
    chosen_creases,
    levels_that_fit,
)
from pns_common.base.blocks import BLOCK_ROWS, Blocks
from pns_common.base.deferred import Deferred
from pns_common.connectivity.creases import Creases, crease_children
from pns_common.crease_lines import named_on_parts
from pns_common.errors import ParameterError
from pns_common.fused import kernel_blocks
from pns_common.masks.crease_shift import limit_crease_shift
from pns_common.masks.limit import refined_limit_normals, refined_limit_positions
from pns_common.mesh import Mesh, check_is_mesh
from pns_common.refine import Report, kernels_can_serve, reference_length_of, report_of
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class PartsRefinement:
    """A refined mesh of several parts, with the report of each; see ``refine.Refinement``."""

    mesh: Mesh
    reports: list[Report]
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]
    normals: Float[np.ndarray, "V 3"] | None = None


def refine_parts(
    mesh: Mesh,
    part_faces: Int[np.ndarray, " Q"],
    scheme: Scheme,
    levels: SupportsIndex = DEFAULT_LEVELS,
    reference_length: float | str = "auto",
    *,
    limit: bool = False,
    creases: Int[np.ndarray, "N 2"] | Creases | Literal["auto"] | None = "auto",
    threads: int | None = None,
) -> PartsRefinement | None:
    """Refine the parts of a mesh, each as if it were alone: same positions, same report, same bits.

    Needs the compiled kernels; None where they cannot serve, and each part must go alone.

    Args:
        mesh: the parts one after the other. No two share a vertex, and their vertices are numbered
            in their order.
        part_faces: where the faces of each of the P parts begin, and where the last one's end.
        scheme, levels, limit, creases, threads: as for ``refine``.
        reference_length: as for ``refine``; "auto" measures each part.

    Raises:
        ParameterError: the parts are not as they must be, or as for ``refine``.
        ModelError: as for ``refine``.
        MeshError: the refined coordinates of any part are too large.
    """
    check_is_mesh(mesh)
    check_scheme(scheme)
    levels = levels_that_fit(levels, len(mesh.faces))
    check_reference_length(reference_length)
    check_limit(limit)
    workers = checked_threads(threads)
    lengths = _reference_lengths(mesh, part_faces, reference_length)
    if not kernels_can_serve(mesh, scheme, levels, float(lengths.min())):
        return None
    part_of_face = np.repeat(np.arange(len(lengths)), np.diff(part_faces))
    kept = named_on_parts(mesh, chosen_creases(creases, scheme), part_of_face, len(lengths))
    from pns_common.fused.levels.side_lengths import side_lengths_of_parts
    from pns_common.fused.refine_parts import Units, refine_parts_fused

    blocks = kernel_blocks(workers)
    sides = Deferred(lambda: side_lengths_of_parts(mesh.vertices, mesh.faces, part_faces, blocks))
    schemes = [scheme.fitted(lambda part=part: sides()[part]) for part in range(len(lengths))]
    units = Units(lengths, np.array([each.prior_strength or 0.0 for each in schemes]))
    made = refine_parts_fused(mesh, part_faces, scheme, levels, units, kept, blocks)
    points, normals = made.points, None
    kept_back = np.zeros(len(lengths))
    if limit:
        topology, blocks = made.split_topology(), Blocks(workers, BLOCK_ROWS)
        shift = limit_crease_shift(made.points, made.faces, crease_children(topology))
        if shift is not None:
            part_of = np.empty(len(made.points), dtype=np.int64)
            part_of[made.faces] = np.repeat(part_of_face, 4**levels)[:, None]
            np.maximum.at(kept_back, part_of[shift.vertices], shift.of_vertices)
        points = refined_limit_positions(made.points, topology, blocks)
        normals = refined_limit_normals(made.points, topology, blocks)
    return PartsRefinement(
        mesh=Mesh.of_refined(points, made.faces),
        reports=[
            report_of(fitted, float(length), multi_fan_vertices, reports, float(back))
            for fitted, length, multi_fan_vertices, reports, back in zip(
                schemes, lengths, made.multi_fan_vertices, made.reports, kept_back, strict=True
            )
        ],
        ratio=made.ratio,
        gate=made.gate,
        normals=normals,
    )


def _reference_lengths(
    mesh: Mesh, part_faces: Int[np.ndarray, " Q"], reference_length: float | str
) -> Float[np.ndarray, " P"]:
    """Return R of each part."""
    first = _first_vertices(mesh, part_faces)
    if reference_length != "auto":
        return np.full(len(part_faces) - 1, float(reference_length))
    lengths = [
        reference_length_of(
            mesh.vertices[first[part] : first[part + 1]],
            mesh.faces[part_faces[part] : part_faces[part + 1]] - first[part],
        )
        for part in range(len(part_faces) - 1)
    ]
    return np.array(lengths)


def _first_vertices(mesh: Mesh, part_faces: Int[np.ndarray, " Q"]) -> Int[np.ndarray, " Q"]:
    """Return where the vertices of each part begin, and where the last one's end."""
    whole = len(part_faces) > 1 and part_faces[0] == 0 and part_faces[-1] == len(mesh.faces)
    if not (whole and (np.diff(part_faces) > 0).all()):
        raise ParameterError("part_faces", part_faces, expected="ascending, from 0 to all faces")
    low = np.minimum.reduceat(mesh.faces.min(axis=1), part_faces[:-1])
    high = np.maximum.reduceat(mesh.faces.max(axis=1), part_faces[:-1])
    if not (low[1:] == high[:-1] + 1).all() or low[0] != 0 or high[-1] != len(mesh.vertices) - 1:
        raise ParameterError("part_faces", part_faces, expected="parts that share no vertex")
    return np.append(low, len(mesh.vertices))
