"""Apply a scheme to a mesh, level by level: the operator's front door."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from jaxtyping import Float, Int

from pns_common.arrays import norm
from pns_common.blocks import Blocks, available_threads
from pns_common.creases import crease_children, with_creases
from pns_common.diagnostics import LevelReport, child_faces, level_report
from pns_common.errors import MeshError, ParameterError
from pns_common.frames import face_normals
from pns_common.mesh import LARGEST_COORDINATE, Mesh
from pns_common.parameters import is_number, is_whole
from pns_common.schemes import ControlLevel, Placement, Scheme
from pns_common.topology import build_topology, multi_fan_vertices, split

HIGHEST_LEVELS = 16


class Report(TypedDict):
    """What a refinement did and how near to Loop it stayed. No times: same input, same report."""

    scheme: str
    budget: float | None
    model: str | None
    model_hash: str | None
    reference_length: float
    multi_fan_vertices: int
    levels: list[LevelReport]


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, its report, and the last level's diagnostics at each of its vertices.

    ``ratio`` and ``gate`` are 0 at old vertices, but where the model has a vertex rule.
    """

    mesh: Mesh
    report: Report
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]


def refine(
    mesh: Mesh,
    scheme: Scheme,
    levels: int = 1,
    reference_length: float | str = "auto",
    *,
    creases: Int[np.ndarray, "N 2"] | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Refinement:
    """Refine a mesh. Each level splits every face in four; nothing is renumbered.

    Args:
        mesh: the control mesh.
        scheme: ``loop()``, ``pns(model)`` or any other.
        levels: number of steps, 1 … 16.
        reference_length: R, the unit of length of the budget: the largest curvature that the
            budget C can represent is 8 C / R. "auto" measures the mesh; 1 is the paper's absolute
            unit. It is fixed here for all levels: pass the first call's R when calling again.
        creases: edges to keep sharp, as pairs of vertices: no correction, and the rules of Hoppe
            et al. 1994. Their children are creases too; boundary and irregular edges stay what
            they are.
        threads: worker threads, default all processors; the result does not depend on it.
        progress: called after each level with (faces made so far, faces made in the end).

    Raises:
        ParameterError: levels, reference_length or threads out of range, a crease that is no edge.
        ModelError: the network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large.
    """
    _check_levels(levels)
    length = _reference_length(mesh, reference_length)
    blocks = Blocks(threads=_threads(threads))
    done, total = 0, sum(len(mesh.faces) * 4**level for level in range(1, levels + 1))

    points, faces = mesh.vertices, mesh.faces
    normals = _face_normals(points, faces, blocks)
    reports: list[LevelReport] = []
    several_fans = 0
    sharp, vertices, edges = creases, None, None
    for level in range(levels):
        topology = build_topology(faces, len(points))
        if level == 0:
            several_fans = int(multi_fan_vertices(topology).sum())
        if sharp is not None:
            topology = with_creases(topology, sharp)
            sharp = crease_children(topology)
        control = ControlLevel(points, topology, normals, length, blocks)
        # What overflows under an absurd budget is caught just below.
        with np.errstate(over="ignore", invalid="ignore"):
            vertices, edges = scheme.vertex_rule(control), scheme.edge_rule(control)
            points = np.concatenate([vertices.positions, edges.positions])
        if not np.abs(points).max() <= LARGEST_COORDINATE:  # also where one is NaN
            raise MeshError("refined coordinates are too large", element="vertices")
        faces = split(topology)
        children = child_faces(topology, points, _loop_points(vertices, edges), blocks)
        normals = children.normals
        reports.append(level_report(topology, vertices, edges, children))
        done += len(faces)
        if progress is not None:
            progress(done, total)
    assert vertices is not None  # levels ≥ 1
    assert edges is not None
    return Refinement(
        mesh=Mesh.of_refined(points, faces),
        report={
            "scheme": scheme.name,
            "budget": scheme.budget,
            "model": scheme.model,
            "model_hash": scheme.model_hash,
            "reference_length": length,
            "multi_fan_vertices": several_fans,
            "levels": reports,
        },
        ratio=np.concatenate([vertices.ratio, edges.ratio]),
        gate=np.concatenate([vertices.gate, edges.gate]),
    )


def measure_reference_length(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> float:
    """R = largest distance of a referenced vertex from the referenced vertices' centroid, over √2.

    About 1 on the paper's patches over [−1, 1]²; unchanged by rotation, proportional to scale.
    """
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.reshape(-1)] = True
    referenced = vertices[used]
    return float(norm(referenced - referenced.mean(axis=0)).max()) / math.sqrt(2)


def _loop_points(vertices: Placement, edges: Placement) -> Float[np.ndarray, "V 3"] | None:
    """Where Loop would have put all vertices; None if they are there."""
    if vertices.displacement is None and edges.displacement is None:
        return None
    return np.concatenate([vertices.loop, edges.loop])


def _face_normals(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], blocks: Blocks
) -> Float[np.ndarray, "F 3"]:
    normals = np.empty((len(faces), 3))

    def measure(rows: slice) -> None:
        normals[rows] = face_normals(points, faces[rows])

    blocks.run(len(faces), measure)
    return normals


def _threads(given: int | None) -> int:
    if given is None:
        return available_threads()
    if not (is_whole(given) and given >= 1):
        raise ParameterError("threads", given, expected="a whole number, at least 1")
    return given


def _check_levels(levels: int) -> None:
    if not (is_whole(levels) and 1 <= levels <= HIGHEST_LEVELS):
        raise ParameterError("levels", levels, expected=f"a whole number, 1 … {HIGHEST_LEVELS}")


def _reference_length(mesh: Mesh, given: float | str) -> float:
    if given == "auto":
        return measure_reference_length(mesh.vertices, mesh.faces)
    if not (is_number(given) and float(given) > 0):
        raise ParameterError("reference_length", given, expected='"auto" or a number > 0')
    return float(given)
