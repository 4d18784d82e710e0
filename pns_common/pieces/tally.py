"""What a level did to a piece's own part of the mesh, so that pieces add up to the whole.

Each face is one piece's own. An edge belongs to the piece of the first face on it, a control vertex
to that of the first face at it, an edge vertex to its edge. Every number here is a count, a largest
value or a sum in steps of 2⁻⁴⁰: exact, in any order and for any number of pieces.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import reduce
from typing import Any, NotRequired, TypedDict

import numpy as np
from jaxtyping import Float

from pns_common.geometry.child_faces import angle_of_chord
from pns_common.levels.diagnostics import GATE_ACTIVE, Displacements, EdgeCounts, limit_distances

STEPS = 2**40
# Steps are summed in two halves: one sum of them all would leave 63 bits at 2²³ numbers near 1.
HALF = 20


@dataclass(frozen=True)
class Summed:
    """Numbers from 0 to about 1: how many, their sum in 2⁻⁴⁰, the largest, how many above 0.01."""

    count: int = 0
    steps: int = 0
    largest: float = 0.0
    active: int = 0

    @classmethod
    def of(cls, values: Float[np.ndarray, " N"]) -> Summed:
        """Sum an array."""
        steps = np.rint(values * STEPS).astype(np.int64)
        total = (int((steps >> HALF).sum()) << HALF) + int((steps & ((1 << HALF) - 1)).sum())
        active = int((values > GATE_ACTIVE).sum())
        return cls(len(values), total, float(values.max(initial=0)), active)

    def __add__(self, other: Summed) -> Summed:
        return Summed(
            self.count + other.count,
            self.steps + other.steps,
            max(self.largest, other.largest),
            self.active + other.active,
        )

    @property
    def mean(self) -> float:
        """The mean, to 2⁻⁴¹; 0 of nothing."""
        return self.steps / self.count / STEPS if self.count else 0.0


@dataclass(frozen=True)
class LevelTally:
    """A level of one piece; the meanings are those of ``diagnostics.LevelReport``.

    Attributes:
        edges: how many of each class, by its number.
        chord: the largest squared distance between the normals of two faces that meet.
        vertex_ratio, vertex_gate: None where the scheme leaves old vertices to Loop.
        displacement, envelope: the largest; of learned levels, and None without a bound.
        shut: of learned levels, rows that the networks were not run for.
        guarded: None where there is no guard.
        crease_shift: None where there are no creases.
    """

    vertices: int
    faces: int
    edges: tuple[int, int, int, int]
    degenerate_frames: int = 0
    flipped_faces: int = 0
    ratio: Summed = Summed()
    gate: Summed = Summed()
    chord: float = 0.0
    vertex_ratio: Summed | None = None
    vertex_gate: Summed | None = None
    learned: bool = False
    displacement: float = 0.0
    envelope: float | None = None
    shut: int = 0
    guarded: int | None = None
    crease_shift: float | None = None

    def __add__(self, other: LevelTally) -> LevelTally:
        return LevelTally(
            vertices=self.vertices + other.vertices,
            faces=self.faces + other.faces,
            edges=_added(self.edges, other.edges),
            degenerate_frames=self.degenerate_frames + other.degenerate_frames,
            flipped_faces=self.flipped_faces + other.flipped_faces,
            ratio=self.ratio + other.ratio,
            gate=self.gate + other.gate,
            chord=max(self.chord, other.chord),
            vertex_ratio=_both(self.vertex_ratio, other.vertex_ratio),
            vertex_gate=_both(self.vertex_gate, other.vertex_gate),
            learned=self.learned or other.learned,
            displacement=max(self.displacement, other.displacement),
            envelope=_larger(self.envelope, other.envelope),
            shut=self.shut + other.shut,
            guarded=_sum(self.guarded, other.guarded),
            crease_shift=_longer(self.crease_shift, other.crease_shift),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the tally for a file; ``of_dict`` reads it."""
        return asdict(self)

    @classmethod
    def of_dict(cls, values: dict[str, Any]) -> LevelTally:
        """Read what ``as_dict`` wrote."""
        summed = {
            name: None if values[name] is None else Summed(**values[name])
            for name in ("ratio", "gate", "vertex_ratio", "vertex_gate")
        }
        changed: dict[str, Any] = {**values, **summed, "edges": tuple(values["edges"])}
        return cls(**changed)


class Measured(TypedDict):
    """The largest and the mean of a ratio or a gate; ``active`` is the gate's share above 0.01."""

    max: float
    mean: float
    active: NotRequired[float]


class ReducedVertices(TypedDict):
    """``diagnostics.VertexSummary`` without percentiles."""

    vertices: int
    proximity_ratio: Measured
    gate: Measured


class ReducedLevel(Displacements):
    """``diagnostics.LevelReport`` without percentiles."""

    vertices: int
    faces: int
    edges: EdgeCounts
    degenerate_frames: int
    flipped_faces: int
    proximity_ratio: Measured
    gate: Measured
    normal_jump_max: float
    vertex_rule: NotRequired[ReducedVertices]
    shut: NotRequired[int]
    guarded: NotRequired[int]


class ReducedReport(TypedDict):
    """The certificate of all levels and each level's numbers; see ``refine.Report``."""

    learned_levels: int
    limit_distance: float
    limit_distance_bound: float | None
    levels: list[ReducedLevel]


def reduced_report(pieces: Iterable[list[LevelTally]]) -> ReducedReport:
    """Make the report of the whole mesh from the tallies of all its pieces, in any order."""
    levels = [reduce(operator.add, level) for level in zip(*pieces, strict=True)]
    reduced = [_reduced(level) for level in levels]
    return {**limit_distances(reduced), "levels": reduced}


def _reduced(level: LevelTally) -> ReducedLevel:
    interior, boundary, irregular, crease = level.edges
    counts: EdgeCounts = {"interior": interior, "boundary": boundary, "irregular": irregular}
    if crease:
        counts["crease"] = crease
    report: ReducedLevel = {
        "vertices": level.vertices,
        "faces": level.faces,
        "edges": counts,
        "degenerate_frames": level.degenerate_frames,
        "flipped_faces": level.flipped_faces,
        "proximity_ratio": _ratio(level.ratio),
        "gate": _gate(level.gate),
        "normal_jump_max": angle_of_chord(level.chord),
    }
    if level.vertex_ratio is not None and level.vertex_gate is not None:
        report["vertex_rule"] = {
            "vertices": level.vertex_ratio.count,
            "proximity_ratio": _ratio(level.vertex_ratio),
            "gate": _gate(level.vertex_gate),
        }
    if level.learned:
        report["displacement_max"] = level.displacement
        report["envelope_max"] = level.envelope
        report["shut"] = level.shut
    if level.guarded is not None:
        report["guarded"] = level.guarded
    if level.crease_shift is not None:
        report["crease_shift_max"] = level.crease_shift
    return report


def _ratio(summed: Summed) -> Measured:
    return {"max": summed.largest, "mean": summed.mean}


def _gate(summed: Summed) -> Measured:
    active = summed.active / summed.count if summed.count else 0.0
    return {"max": summed.largest, "mean": summed.mean, "active": active}


def _added(
    first: tuple[int, int, int, int], second: tuple[int, int, int, int]
) -> tuple[int, int, int, int]:
    return (first[0] + second[0], first[1] + second[1], first[2] + second[2], first[3] + second[3])


def _both(first: Summed | None, second: Summed | None) -> Summed | None:
    return None if first is None or second is None else first + second


def _larger(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else max(first, second)


def _longer(first: float | None, second: float | None) -> float | None:
    """Return the larger of two; None is nothing at all."""
    return max((value for value in (first, second) if value is not None), default=None)


def _sum(first: int | None, second: int | None) -> int | None:
    return None if first is None or second is None else first + second
