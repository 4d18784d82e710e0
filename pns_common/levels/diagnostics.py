"""The report of one step: counts, proximity ratio, gate use, flipped faces, normal jump."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NotRequired, TypedDict

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import dot
from pns_common.base.blocks import BLOCK_ROWS
from pns_common.connectivity.topology import Connectivity, EdgeClass
from pns_common.geometry.child_faces import ChildAngles
from pns_common.levels.step import AddedStep
from pns_common.rules.placement import Added

# A gate above this counts as active.
GATE_ACTIVE = 0.01


class EdgeCounts(TypedDict):
    """The edges that a level refined, by class; ``crease`` only where there are some."""

    interior: int
    boundary: int
    irregular: int
    crease: NotRequired[int]


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
    """The vertex rule: how many old vertices it may move, their ratio and γ_v (0 on curves)."""

    vertices: int
    proximity_ratio: RatioSummary
    gate: GateSummary


class Displacements(TypedDict):
    """How far a level left Loop, where it did; see LevelReport."""

    displacement_max: NotRequired[float]
    envelope_max: NotRequired[float | None]
    crease_shift_max: NotRequired[float]


class LevelReport(Displacements):
    """One level: counts of the mesh it made and diagnostics of the step that made it.

    ``vertex_rule`` stands only where the model has one; ``proximity_ratio`` and ``gate`` are the
    interior edges', and so is ``normal_jump_max``, the largest angle in radians between the faces
    beside one: a crease turns as it should, and is none of them. Of learned levels alone:
    ``displacement_max``, the longest δ, and ``envelope_max``, the longest that the budget allows
    where a gate is open (None where the rules name no bound), both in the mesh's units; ``shut``,
    at how many interior edges and movable vertices the gate is 0, so that the network was not run
    for them; and ``guarded``, how many vertices the fold guard scaled, where there is one. Where
    there are creases, ``crease_shift_max`` is the longest way from where Loop's smooth rules would
    have had a vertex at them to where it is.
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
    shut: NotRequired[int]
    guarded: NotRequired[int]


@dataclass(frozen=True)
class Reach:
    """How far a learned step left Loop: the longest δ, and the longest that the budget allows.

    ``bound`` is None where the rules name none.
    """

    longest: float
    bound: float | None


class LimitDistances(TypedDict):
    """How far all levels together left Loop; see ``refine.Report``."""

    learned_levels: int
    limit_distance: float
    limit_distance_bound: float | None


def reach_of(step: AddedStep) -> Reach:
    """Look for the longest that a learned step added, and the longest that it might have."""
    rules = (step.vertices, step.edges)
    return Reach(max(_longest(rule.displacement) for rule in rules), bound_of(step))


def bound_of(step: AddedStep) -> float | None:
    """Return the longest that a learned step might have added; None where rules name no bound."""
    bounds = [_largest(rule) for rule in (step.vertices, step.edges)]
    known = [bound for bound in bounds if bound is not None]
    return max(known) if len(known) == len(bounds) else None


def level_report(
    topology: Connectivity,
    step: AddedStep,
    children: ChildAngles,
    shift: float | None,
    reach: Reach | None = None,
) -> LevelReport:
    """Summarise the step that refined ``topology``; ``shift`` is the longest way at creases.

    ``reach`` is that of a learned step, where it is known.
    """
    vertices, edges = step.vertices, step.edges
    gate, shut = _of(edges.gate, topology.interior), 0
    report: LevelReport = {
        "vertices": topology.vertex_count + len(topology.edge_class),
        "faces": 4 * len(topology.faces),
        "edges": edge_counts(topology.edge_class),
        "degenerate_frames": int(edges.degenerate.sum() + vertices.degenerate.sum()),
        "flipped_faces": children.flipped,
        "proximity_ratio": _ratio_summary(_of(edges.ratio, topology.interior)),
        "gate": _gate_summary(gate),
        "normal_jump_max": children.normal_jump_max,
    }
    if vertices.corrected is not None:
        vertex_gate = _of(vertices.gate, vertices.corrected)
        report["vertex_rule"] = {
            "vertices": int(vertices.corrected.sum()),
            "proximity_ratio": _ratio_summary(_of(vertices.ratio, vertices.corrected)),
            "gate": _gate_summary(vertex_gate),
        }
        shut = _shut(vertex_gate)
    if step.learned:
        reach = reach or reach_of(step)
        report["displacement_max"] = reach.longest
        report["envelope_max"] = reach.bound
        report["shut"] = _shut(gate) + shut
    if step.guard is not None:
        report["guarded"] = int((step.guard < 1).sum())
    if shift is not None:
        report["crease_shift_max"] = shift
    return report


def limit_distances(levels: Sequence[Displacements], limit_shift: float = 0.0) -> LimitDistances:
    """Sum what the levels' displacements may add up to; what creases keep back is one as well.

    Loop's masks and limit masks are non-negative and sum to 1, so a displacement at one level moves
    no later vertex, and no point of the limit, by more than its own length. At a crease a shift is
    all that a vertex was moved by, a learned rule's part with it. ``limit_shift`` is the longest
    way that creases keep a vertex that was put on the limit surface.
    """
    shifts = [level.get("crease_shift_max", 0.0) for level in levels]
    moved = [level.get("displacement_max", 0.0) for level in levels]
    allowed = [level.get("envelope_max", 0.0) for level in levels]
    known = [bound for bound in allowed if bound is not None]
    bound = None
    if len(known) == len(levels):
        bound = float(sum(map(max, known, shifts)) + limit_shift)
    return {
        "learned_levels": sum("displacement_max" in level for level in levels),
        "limit_distance": float(sum(map(max, moved, shifts)) + limit_shift),
        "limit_distance_bound": bound,
    }


def _of(values: Float[np.ndarray, " N"], rows: np.ndarray) -> Float[np.ndarray, " M"]:
    """Return some of the values, by indices or flags; no copy where they are all."""
    all_of_them = rows.all() if rows.dtype == bool else len(rows) == len(values)
    return values if all_of_them else values[rows]


def _longest(displacement: Float[np.ndarray, "N 3"] | None) -> float:
    """Return the largest length; of the squares, since a root keeps their order."""
    if displacement is None:
        return 0.0
    largest = 0.0
    for start in range(0, len(displacement), BLOCK_ROWS):
        some = displacement[start : start + BLOCK_ROWS]
        largest = max(largest, float(dot(some, some).max()))
    return math.sqrt(largest)


def _largest(rule: Added) -> float | None:
    """Return the largest displacement that a rule may make; None where it may make any."""
    if rule.displacement is None:
        return 0.0
    return None if rule.envelope is None else float(rule.envelope.max(initial=0))


def _shut(gate: Float[np.ndarray, " N"]) -> int:
    return int(np.count_nonzero(gate == 0))


def edge_counts(edge_class: Int[np.ndarray, " E"]) -> EdgeCounts:
    """Count the edges of each class."""

    # An enumeration's member would be compared in 64 bits, seven times as long.
    def count(kind: EdgeClass) -> int:
        return int(np.count_nonzero(edge_class == int(kind)))

    counts: EdgeCounts = {
        "interior": count(EdgeClass.INTERIOR),
        "boundary": count(EdgeClass.BOUNDARY),
        "irregular": count(EdgeClass.IRREGULAR),
    }
    rest = len(edge_class) - counts["interior"] - counts["boundary"] - counts["irregular"]
    if rest:
        counts["crease"] = rest
    return counts


def _ratio_summary(ratio: Float[np.ndarray, " N"]) -> RatioSummary:
    some = len(ratio) > 0
    return {
        "max": float(ratio.max(initial=0)),
        "mean": _mean(ratio) if some else 0.0,
        "p99": _p99(ratio) if some else 0.0,
    }


def _mean(values: Float[np.ndarray, " N"]) -> float:
    """Return ``values.mean()``, without what surrounds its sum."""
    return float(np.add.reduce(values)) / len(values)


def _p99(values: Float[np.ndarray, " N"]) -> float:
    """Return ``np.percentile(values, 99)``, whose checks take longest of all in a small mesh."""
    position = (len(values) - 1) * 0.99
    below = int(position)
    above = min(below + 1, len(values) - 1)
    ordered = np.partition(values, [below, above])
    low, high = ordered[below], ordered[above]
    t = position - below
    # From the nearer side, as numpy does it.
    return float(high - (high - low) * (1 - t) if t >= 0.5 else low + (high - low) * t)


def _gate_summary(gate: Float[np.ndarray, " N"]) -> GateSummary:
    some = len(gate) > 0
    return {
        "mean": _mean(gate) if some else 0.0,
        "max": float(gate.max(initial=0)),
        "active": int(np.count_nonzero(gate > GATE_ACTIVE)) / len(gate) if some else 0.0,
    }
