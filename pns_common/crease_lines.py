"""The crease lines of a mesh, by whoever finds them sooner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import available_threads
from pns_common.base.parameters import is_number
from pns_common.connectivity.creases import Creases, pair_keys, with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.errors import ParameterError
from pns_common.fused import fits, kernel_blocks, kernels_available, kernels_loaded
from pns_common.geometry.crease_lines import (
    CREASE_ANGLE,
    CREASE_LEVELS,
    EDGED_ANGLE,
    is_edged,
    line_rows,
)
from pns_common.geometry.crease_lines.edge_rows import stand_alone
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.geometry.crease_lines.turns import Edges, cosine_of, edges_beyond
from pns_common.geometry.frames import face_normals
from pns_common.mesh import Mesh, check_is_mesh

LINES = Creases(line_angle=CREASE_ANGLE, levels=CREASE_LEVELS, edged_angle=EDGED_ANGLE)
NO_PAIRS = np.zeros((0, 2), dtype=np.int64)


def crease_lines(mesh: Mesh, angle: float | None = None) -> Int[np.ndarray, "N 2"]:
    """Return the edges that a mesh shows to be sharp, as pairs of vertices, for ``refine``.

    These turn by more than ``angle`` (degrees, between 0 and 180), lie between two sides of a part,
    and go on at both ends. None: by more than 66 degrees, and where at least half of the edges
    beyond 21 degrees that are in no row of like ones are beyond 66, all of these, and elsewhere
    those beside plane sides that were cut finely; so the default model keeps them
    (geometry/crease_lines). With them go edges within plane sides that begin on them and would fold
    these sides, as the mitres of a frame.

    Raises:
        ParameterError: it is no Mesh, or the angle is out of range.
    """
    check_is_mesh(mesh)
    if not (angle is None or (is_number(angle) and 0 < angle < 180)):
        raise ParameterError("angle", angle, expected="degrees between 0 and 180")
    asked = LINES if angle is None else Creases(line_angle=float(angle))
    look = _look(mesh.vertices, mesh.faces, None)
    return look.sharp(look.line_rows(asked))


@dataclass(frozen=True, eq=False)
class _Look:
    """A mesh's edges, those that are named as creases, and what finds some of them.

    Attributes:
        points: the mesh's vertices.
        normals: unit normals of its faces.
        line_rows: returns the edges of the lines that creases say to look for.
        rows_beyond: returns the interior edges that turn by more than an angle in degrees.
        alone: returns which of some stand alone.
    """

    points: Float[np.ndarray, "V 3"]
    normals: Float[np.ndarray, "F 3"]
    edges: Edges
    line_rows: Callable[[Creases], Int[np.ndarray, " N"]]
    rows_beyond: Callable[[float], Int[np.ndarray, " N"]]
    alone: Callable[[Int[np.ndarray, " N"]], Bool[np.ndarray, " N"]]

    def sharp(self, lines: Int[np.ndarray, " N"]) -> Int[np.ndarray, "M 2"]:
        """Return the edges of lines, and those held beside them, as pairs of vertices."""
        rows = with_held_edges(self.points, self.normals, self.edges, lines)
        return self.edges.edges[rows].astype(np.int64)

    def are_among(
        self, rows: Int[np.ndarray, " N"], pairs: Int[np.ndarray, "P 2"]
    ) -> Bool[np.ndarray, " N"]:
        """Return which edges are among pairs of vertices."""
        count = len(self.points)
        return np.isin(pair_keys(self.edges.edges[rows], count), pair_keys(pairs, count))

    def turns(
        self, creases: Creases, part_of_face: Int[np.ndarray, " F"], count: int
    ) -> Int[np.ndarray, "P 2"]:
        """Count as ``turns_of_parts``."""
        assert creases.line_angle is not None
        assert creases.edged_angle is not None
        sharp, bent = map(self.rows_beyond, (creases.line_angle, creases.edged_angle))
        alone = bent[self.alone(bent)]
        first = (self.edges.half_edges[rows, 0] // 3 for rows in (sharp, alone))
        return np.stack([np.bincount(part_of_face[f], minlength=count) for f in first], axis=1)


def _look(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    named: Int[np.ndarray, "N 2"] | None,
) -> _Look:
    """Look at a mesh, by kernels where they are loaded.

    Raises:
        ParameterError: one that is named is no edge.
    """
    if kernels_available() and kernels_loaded() and fits(len(points), len(faces), 1):
        from pns_common.fused.levels import crease_lines as fused
        from pns_common.fused.levels.face_measures import face_normals as measured_normals
        from pns_common.fused.levels.level import control_edges

        blocks = kernel_blocks(available_threads())
        edges = control_edges(faces, len(points), named, blocks)
        measured = measured_normals(points, edges.faces, blocks)

        def rows_beyond(angle: float) -> Int[np.ndarray, " N"]:
            beyond, _ = fused.edges_beyond(edges, measured, cosine_of(angle), blocks)
            return np.flatnonzero(beyond).astype(np.int32)

        return _Look(
            points,
            measured,
            edges,
            lambda creases: fused.crease_line_rows(points, edges, measured, creases, blocks),
            rows_beyond,
            lambda rows: fused.edges_alone(points, edges, measured, rows, blocks),
        )
    topology = with_creases(build_topology(faces, len(points)), named)
    normals = face_normals(points, faces)
    return _Look(
        points,
        normals,
        topology,
        lambda creases: line_rows(points, normals, topology, creases),
        lambda angle: edges_beyond(normals, topology, topology.interior, cosine_of(angle)),
        lambda rows: stand_alone(points, normals, topology, rows),
    )


def named_on(mesh: Mesh, creases: Creases, smooth: Int[np.ndarray, "N 2"] = NO_PAIRS) -> Creases:
    """Return creases with the lines that they look for found on a mesh, by name.

    Lines that it has for being edged alone are none where they are ``smooth``, as was said of them.
    """
    part_of_face = np.zeros(len(mesh.faces), dtype=np.int64)
    return named_on_parts(mesh, creases, part_of_face, 1, smooth)


def named_on_parts(
    mesh: Mesh,
    creases: Creases,
    part_of_face: Int[np.ndarray, " F"],
    count: int,
    smooth: Int[np.ndarray, "N 2"] = NO_PAIRS,
) -> Creases:
    """Return the same of a mesh of so many parts that share no vertex, each edged or not."""
    if creases.line_angle is None:
        return creases
    look = _look(mesh.vertices, mesh.faces, creases.named)
    lines = look.line_rows
    if creases.edged_angle is None or (count == 1 and len(smooth) == 0):
        return _with_sharp(creases, look.sharp(lines(creases)))
    edged = np.full(count, bool(creases.edged))
    if creases.edged is None:
        edged = _edged(look.turns(creases, part_of_face, count))
    rows = lines(replace(creases, edged=False))
    if edged.any():
        part_of_vertex = np.zeros(len(mesh.vertices), dtype=np.int64)
        part_of_vertex[mesh.faces] = part_of_face[:, None]
        in_edged = edged[part_of_vertex[look.edges.edges[:, 0]]]
        gentle = lines(replace(creases, edged=True))
        meant = ~look.are_among(gentle, smooth)
        gentle = gentle[np.isin(gentle, rows) | meant]
        rows = np.sort(np.concatenate([rows[~in_edged[rows]], gentle[in_edged[gentle]]]))
    return _with_sharp(creases, look.sharp(rows))


def _with_sharp(creases: Creases, sharp: Int[np.ndarray, "N 2"]) -> Creases:
    """Return the creases that are named, and what a mesh shows to be sharp, as creases by name."""
    named = sharp if creases.named is None else np.concatenate([creases.named, sharp])
    return Creases(named, levels=creases.levels)


def turns_of_parts(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Creases,
    part_of_face: Int[np.ndarray, " F"],
    count: int,
) -> Int[np.ndarray, "P 2"]:
    """Count each part's interior edges that turn by more than θ, and by more than θ' in no row.

    An edge is of the part of the first face on it. Those that are named are creases, not interior.
    """
    return _look(points, faces, creases.named).turns(creases, part_of_face, count)


def _edged(turns: Int[np.ndarray, "P 2"]) -> Bool[np.ndarray, " P"]:
    return np.array([is_edged(sharp, bent) for sharp, bent in turns.tolist()], dtype=bool)
