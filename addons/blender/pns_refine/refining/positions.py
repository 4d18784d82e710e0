"""Positions of the vertices: `pns_common.refine`, with creases that may wear off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from pns_common import Creases, Mesh, Refinement, Scheme, refine
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.mesh.topology import Topology
from pns_common.operator.scheme import named_scheme
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes.limit import limit_normals, limit_positions, limit_shift

from .steps import Steps

Progress = Callable[[int, int], None]
# How far from the base scheme a level may have gone, and how far its budget allows.
_Distances = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Positions:
    """Refined vertices and the report, with ratio and gate of the last level that corrected.

    ``controls`` are the vertices before they were put on the limit surface.
    """

    points: Float[np.ndarray, "W 3"]
    controls: Float[np.ndarray, "W 3"]
    ratio: Float[np.ndarray, " L"]
    gate: Float[np.ndarray, " L"]
    normals: Float[np.ndarray, "W 3"] | None
    report: dict[str, Any]


def refine_positions(
    mesh: Mesh, scheme: Scheme, steps: Steps, *, limit: bool, progress: Progress
) -> Positions:
    """Refine the vertices of a mesh; ``limit`` puts them where the base scheme would end.

    A crease that the last level keeps sharp is then sharp for good, as ``refine`` has it.

    Raises:
        PnsError: the mesh cannot be refined, or the model fails; and whatever ``progress`` raises.
    """
    if steps.wears_off:
        return _level_by_level(mesh, scheme, steps, limit=limit, progress=progress)
    first, levels = steps.steps[0], len(steps.steps)
    creases = _with_corners(Creases(first.creases), first.topology)
    made = refine(mesh, scheme, levels, creases=creases, limit=limit, progress=progress)
    added = next((step.added for step in reversed(made.steps) if step.added), None)
    acted = made if added is None else added
    points = made.mesh.vertices, made.steps[-1].points
    return Positions(*points, acted.ratio, acted.gate, made.normals, dict(made.report))


def _level_by_level(
    mesh: Mesh, scheme: Scheme, steps: Steps, *, limit: bool, progress: Progress
) -> Positions:
    """Refine level by level with the creases of each; half sharp ones mix two readings.

    Both readings lie within the budget of the base scheme's, so their mixture lies within the
    budget of the mixture of those. Such a level's report is the sharper reading's; its distance to
    the base scheme is the larger of both.
    """
    length = measure_reference_length(mesh.vertices, mesh.corners)
    counter, acted = _Counter(progress, steps), None
    reports: list[Any] = []
    distances: list[_Distances] = []
    for depth, step in enumerate(steps.steps):
        rule = scheme if scheme.acts_at(depth) else named_scheme(steps.base.name)
        soft = _with_corners(step.soft, step.topology)
        smooth = made = counter.reading(mesh, rule, length, soft.with_named(step.creases))
        points, readings = made.mesh.vertices, [_distances(made.report)]
        if step.mixture is not None:
            made = counter.reading(mesh, rule, length, soft.with_named(step.mixture.creases))
            points = step.mixture.of(smooth.mesh.vertices, made.mesh.vertices)
            readings.append(_distances(made.report))
        acted = made if acted is None or scheme.acts_at(depth) else acted
        reports.append(made.report)
        distances.append(_combined(readings, max))
        mesh = Mesh(points, made.mesh.faces)
    points, normals = mesh.vertices, None
    if limit:
        at_last = steps.at_last, Blocks(available_threads()), steps.base
        kept_back = limit_shift(mesh.vertices, *at_last)
        distances.append((kept_back, kept_back))
        points = limit_positions(mesh.vertices, *at_last)
        normals = limit_normals(mesh.vertices, *at_last).vertices
    report = _one_report(reports, _combined(distances, sum))
    return Positions(points, mesh.vertices, acted.ratio, acted.gate, normals, report)


def _with_corners(creases: Creases, topology: Topology) -> Creases:
    """Return creases with the vertices that are corners of a level's topology, borders' too."""
    vertices = np.flatnonzero(topology.vertex_sharpness)
    return replace(creases, vertices=vertices, vertex_sharpness=topology.vertex_sharpness[vertices])


def _distances(report: Any) -> _Distances:
    return report["limit_distance"], report["limit_distance_bound"]


def _combined(distances: list[_Distances], combine: Callable[[list[float]], float]) -> _Distances:
    """Return the largest or the sum of some distances, and of their bounds."""
    return combine([distance for distance, _ in distances]), combine([b for _, b in distances])


def _one_report(reports: list[Any], distances: _Distances) -> dict[str, Any]:
    """Return the report of all levels, from those of each."""
    distance, bound = distances
    return dict(reports[0]) | {
        "levels": [level for part in reports for level in part["levels"]],
        "learned_levels": sum(part["learned_levels"] for part in reports),
        "limit_distance": distance,
        "limit_distance_bound": bound,
    }


class _Counter:
    """Refines by one level, and counts the faces made over all of them."""

    def __init__(self, progress: Progress, steps: Steps) -> None:
        self._progress, self._done = progress, 0
        following = [step.topology for step in steps.steps[1:]] + [steps.final]
        self._total = sum(
            finer.face_count * (1 if step.mixture is None else 2)
            for step, finer in zip(steps.steps, following, strict=True)
        )

    def reading(
        self,
        mesh: Mesh,
        scheme: Scheme,
        length: float,
        creases: Creases,
    ) -> Refinement:
        made = refine(mesh, scheme, 1, length, limit=False, creases=creases, progress=self._tell)
        self._done += made.mesh.face_count
        return made

    def _tell(self, done: int, total: int) -> None:
        self._progress(self._done + done, self._total)
