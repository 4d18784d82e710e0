"""The report of a refinement: counts, proximity ratios, gates, turns; data, and no times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NotRequired, TypedDict

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import children, connectivity
from pns_common.mesh.normals import face_normals
from pns_common.mesh.rows import dot
from pns_common.mesh.topology import EdgeClass, Topology, quad_faces, split_faces
from pns_common.operator.formula import Additions
from pns_common.parallel import Blocks

# A gate above this counts as active.
GATE_ACTIVE = 0.01


class EdgeCounts(TypedDict):
    """The edges that a level refined, by class; ``crease`` and ``soft`` only where there are some.

    ``soft`` counts the interior edges of sharpness above ½.
    """

    interior: int
    boundary: int
    irregular: int
    crease: NotRequired[int]
    soft: NotRequired[int]


class RatioSummary(TypedDict):
    """Proximity ratio ‖δ‖ R / (C h²) of interior edges or movable vertices; above 1 by rounding."""

    max: float
    mean: float
    p99: float


class GateSummary(TypedDict):
    """Gate γ of interior edges, or of movable vertices; ``active`` is the share above 0.01."""

    mean: float
    max: float
    active: float


class VertexSummary(TypedDict):
    """The vertex rule: old vertices that it may move, their ratio, and γ_v (0 on curves)."""

    vertices: int
    proximity_ratio: RatioSummary
    gate: GateSummary


class Distances(TypedDict):
    """Distances of a level from the smooth base scheme; see LevelReport."""

    displacement_max: NotRequired[float]
    envelope_max: NotRequired[float]
    crease_shift_max: NotRequired[float]


class LevelReport(Distances):
    """One level: counts of the mesh that it made, and diagnostics of the step that made it.

    ``proximity_ratio`` and ``gate`` are those of interior edges, not of creases;
    ``normal_jump_max``, the largest angle in radians between the children beside an edge, leaves
    edges of sharpness above ½ out as well. ``vertex_rule`` exists
    where the model moves old vertices. Learned levels alone have ``displacement_max``, the longest
    δ, and ``envelope_max``, the longest that the budget allows where a gate is open, both in the
    mesh's units; ``shut``, the number of interior edges and movable vertices whose gate is 0; and,
    with a fold guard, ``guarded``, the number of vertices that it scaled. With creases,
    ``crease_shift_max`` is the longest way from where the smooth rules put a vertex of a crease to
    where it is.
    """

    vertices: int
    faces: int
    edges: EdgeCounts
    degenerate_frames: int
    flipped_faces: int
    proximity_ratio: RatioSummary
    gate: GateSummary
    normal_jump_max: float
    vertex_rule: NotRequired[VertexSummary]
    face_rule: NotRequired[VertexSummary]
    shut: NotRequired[int]
    guarded: NotRequired[int]


class LimitDistances(TypedDict):
    """Distances of all levels together from the smooth base scheme; see Report."""

    learned_levels: int
    limit_distance: float
    limit_distance_bound: float


class AdaptiveReport(TypedDict):
    """Faces of several levels: the goal, in the mesh's units, and what was reached.

    ``faces_by_level`` counts faces by how often the control face was split, and ``distance_max`` is
    the largest bound of a face's distance from the limit surface: above ``tolerance`` only where
    the deepest level did not suffice, or ``max_faces`` ended it. ``angle_max`` is the largest
    measured angle between normals of a face, in degrees; None where no angle was asked for.
    """

    tolerance: float | None
    angle: float | None
    max_edge_length: float | None
    max_faces: int | None
    vertices: int
    faces: int
    faces_by_level: list[int]
    distance_max: float
    angle_max: float | None


class Report(LimitDistances):
    """The report of a refinement. The same input gives the same report.

    ``learned_levels`` counts the levels at which the learned rule acted. ``limit_distance`` is the
    sum over levels of the longest displacement, in the mesh's units: no vertex, and no point of the
    limit surface, is farther from where the base scheme would have had it. What creases keep back
    from the smooth rules counts too, but with a goal that of the first level alone.
    ``limit_distance_bound`` is the sum of the longest that the budget allows.
    """

    scheme: str
    budget: float | None
    model: str | None
    model_hash: str | None
    reference_length: float
    multi_fan_vertices: int
    levels: list[LevelReport]
    adaptive: NotRequired[AdaptiveReport]


def child_angles(
    parent: Topology,
    points: Float[np.ndarray, "W 3"],
    base_points: Float[np.ndarray, "W 3"] | None,
    blocks: Blocks,
    quads: bool,
) -> tuple[int, float]:
    """Return how many children are flipped, and the largest angle between children in radians.

    Args:
        parent: the mesh that was split.
        points: vertices of the split mesh.
        base_points: where the base scheme puts them; None where no child can be flipped.
        blocks: how work is shared.
        quads: whether each corner became a quad; else each triangle four.
    """
    faces = quad_faces(parent, blocks) if quads else split_faces(parent, blocks)
    normals, smooth = face_normals(points, faces, blocks), parent.edge_class
    if len(parent.soft):
        smooth = np.where(parent.is_sharp, EdgeClass.CREASE, smooth).astype(np.int8)
    read = parent.connectivity._replace(edge_class=smooth), quads, normals
    inside = blocks.run(parent.face_count, children.largest_chord_inside, *read)
    across = blocks.run(len(parent.edges), children.largest_chord_across, *read)
    flipped = 0
    if base_points is not None:
        others = face_normals(base_points, faces, blocks)
        flipped = int(np.count_nonzero(dot(normals, others) < 0))
    chord = max(*inside, *across, 0.0)
    return flipped, 2 * math.asin(min(math.sqrt(chord) / 2, 1.0))


def level_report(
    parent: Topology,
    added: Additions | None,
    flipped: int,
    jump: float,
    crease_shift: float | None,
    quads: bool,
) -> LevelReport:
    """Summarise the step that refined ``parent``; ``added`` is None for the base scheme."""
    count = parent.vertex_count
    none = np.zeros(0)
    of_edges = slice(count, count + len(parent.edges))
    ratio = none if added is None else _of(added.ratio[of_edges], parent.interior)
    gate = none if added is None else _of(added.gate[of_edges], parent.interior)
    report: LevelReport = {
        "vertices": count + len(parent.edges) + (parent.face_count if quads else 0),
        "faces": len(parent.corners) if quads else 4 * parent.face_count,
        "edges": edge_counts(parent),
        "degenerate_frames": 0 if added is None else added.degenerate,
        "flipped_faces": flipped,
        "proximity_ratio": _ratio_summary(ratio),
        "gate": _gate_summary(gate),
        "normal_jump_max": jump,
    }
    if added is not None:
        shut = _shut(gate)
        if added.corrected is not None:
            vertex_gate = _of(added.gate[:count], added.corrected)
            ratio = _of(added.ratio[:count], added.corrected)
            report["vertex_rule"] = _vertex_summary(ratio, vertex_gate)
            shut += _shut(vertex_gate)
            if quads:
                ratio, gate = (rows[of_edges.stop :] for rows in (added.ratio, added.gate))
                report["face_rule"] = _vertex_summary(ratio, gate)
                shut += _shut(gate)
        report["displacement_max"] = longest(added.displacement)
        report["envelope_max"] = float(added.bound.max(initial=0))
        report["shut"] = shut
        if added.scale is not None:
            report["guarded"] = int((added.scale < 1).sum())
    if crease_shift is not None:
        report["crease_shift_max"] = crease_shift
    return report


def limit_distances(levels: Sequence[Distances], limit_shift: float = 0.0) -> LimitDistances:
    """Sum the levels' largest displacements, and what creases keep back.

    The masks of a base scheme, and its limit masks, are non-negative and sum to 1, so a
    displacement at one level moves no later vertex, and no point of the limit, by more than its own
    length. ``limit_shift`` is the longest way that creases keep a vertex of the limit surface.
    """
    shifts = [level.get("crease_shift_max", 0.0) for level in levels]
    moved = [level.get("displacement_max", 0.0) for level in levels]
    allowed = [level.get("envelope_max", 0.0) for level in levels]
    return {
        "learned_levels": sum("displacement_max" in level for level in levels),
        "limit_distance": float(sum(map(max, moved, shifts)) + limit_shift),
        "limit_distance_bound": float(sum(map(max, allowed, shifts)) + limit_shift),
    }


def longest(displacement: Float[np.ndarray, "W 3"]) -> float:
    """Return the largest length of N ≥ 0 vectors."""
    squares = np.einsum("ij,ij->i", displacement, displacement)
    return math.sqrt(float(squares.max(initial=0)))


def edge_counts(mesh: Topology) -> EdgeCounts:
    """Count the edges of each class."""
    count = np.bincount(mesh.edge_class, minlength=4).tolist()
    counts: EdgeCounts = {
        "interior": count[connectivity.INTERIOR],
        "boundary": count[connectivity.BOUNDARY],
        "irregular": count[connectivity.IRREGULAR],
    }
    if count[connectivity.CREASE]:
        counts["crease"] = count[connectivity.CREASE]
    if soft := int(np.count_nonzero(mesh.is_sharp)) - count[connectivity.CREASE]:
        counts["soft"] = soft
    return counts


def _of(
    values: Float[np.ndarray, " N"], rows: Integer[np.ndarray, " M"] | Bool[np.ndarray, " N"]
) -> Float[np.ndarray, " M"]:
    """Return some of the values; no copy where they are all."""
    every = rows.all() if rows.dtype == bool else len(rows) == len(values)
    return values if every else values[rows]


def _vertex_summary(ratio: Float[np.ndarray, " N"], gate: Float[np.ndarray, " N"]) -> VertexSummary:
    ratios, gates = _ratio_summary(ratio), _gate_summary(gate)
    return {"vertices": len(gate), "proximity_ratio": ratios, "gate": gates}


def _shut(gate: Float[np.ndarray, " N"]) -> int:
    return int(np.count_nonzero(gate == 0))


def _ratio_summary(ratio: Float[np.ndarray, " N"]) -> RatioSummary:
    if len(ratio) == 0:
        return {"max": 0.0, "mean": 0.0, "p99": 0.0}
    return {"max": float(ratio.max()), "mean": float(ratio.mean()), "p99": _p99(ratio)}


def _p99(values: Float[np.ndarray, " N"]) -> float:
    """Return ``np.percentile(values, 99)`` without its checks, which dominate in small meshes."""
    position = (len(values) - 1) * 0.99
    below = int(position)
    above = min(below + 1, len(values) - 1)
    ordered = np.partition(values, [below, above])
    low, high, t = ordered[below], ordered[above], position - below
    return float(high - (high - low) * (1 - t) if t >= 1 / 2 else low + (high - low) * t)


def _gate_summary(gate: Float[np.ndarray, " N"]) -> GateSummary:
    if len(gate) == 0:
        return {"mean": 0.0, "max": 0.0, "active": 0.0}
    active = int(np.count_nonzero(gate > GATE_ACTIVE)) / len(gate)
    return {"mean": float(gate.mean()), "max": float(gate.max()), "active": active}
