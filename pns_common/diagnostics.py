"""Measured numbers of one step: proximity ratio, gate use, flipped faces, normal jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NotRequired, TypedDict

import numpy as np
from jaxtyping import Bool, Float

from pns_common.arrays import dot, gather
from pns_common.blocks import Blocks
from pns_common.frames import triangle_normals
from pns_common.schemes import Placement
from pns_common.topology import CHILDREN, EdgeClass, Topology, children_across

# A gate above this counts as active.
GATE_ACTIVE = 0.01


class EdgeCounts(TypedDict):
    """The edges that a level refined, by class; ``crease`` only where there are some."""

    interior: int
    boundary: int
    irregular: int
    crease: NotRequired[int]


class RatioSummary(TypedDict):
    """Proximity ratio ‖δ‖ / (C h²) over the level's interior edges; above 1 by rounding only."""

    max: float
    mean: float
    p99: float


class GateSummary(TypedDict):
    """Gate γ over the level's interior edges; ``active`` is the share above 0.01."""

    mean: float
    max: float
    active: float


class VertexSummary(TypedDict):
    """The vertex rule: how many old vertices it may move, ‖δ‖ / (C h_v²) and γ_v over them."""

    vertices: int
    proximity_ratio: RatioSummary
    gate: GateSummary


class LevelReport(TypedDict):
    """One level: counts of the mesh it made and diagnostics of the step that made it.

    ``vertex_rule`` stands only where the model has one; ``proximity_ratio`` and ``gate`` are the
    interior edges'.
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


@dataclass(frozen=True, eq=False)
class ChildFaces:
    """The faces that a step made.

    Attributes:
        normals: unit normals, 0 where a face has no area.
        flipped: number of faces whose normal opposes that of their Loop counterpart.
        normal_jump_max: largest angle (radians, 0 … π) between the normals of two faces that share
            an interior edge; faces without area are left out.
    """

    normals: Float[np.ndarray, "F 3"]
    flipped: int
    normal_jump_max: float


def child_faces(
    topology: Topology,
    points: Float[np.ndarray, "V 3"],
    loop_points: Float[np.ndarray, "V 3"] | None,
    blocks: Blocks,
) -> ChildFaces:
    """Look at the faces that ``topology`` was split into.

    ``points`` are old vertices, then edge vertices; ``loop_points`` is where Loop would have put
    them, None if they are there.
    """
    normals = np.empty((len(topology.faces), 4, 3))
    has_area = np.empty((len(topology.faces), 4), dtype=bool)
    flipped = np.zeros(len(topology.faces), dtype=np.int64)
    inside = np.zeros(blocks.count(len(topology.faces)))

    def look_inside(rows: slice) -> None:
        six = np.concatenate(
            [topology.faces[rows], topology.face_edges[rows] + topology.vertex_count], axis=1
        ).T
        corners = [gather(points, vertex) for vertex in six]
        four = [triangle_normals(*(corners[i] for i in child)) for child in CHILDREN]
        for child, normal in enumerate(four):
            normals[rows, child] = normal
            has_area[rows, child] = dot(normal, normal) > 0
        defined = has_area[rows]
        inside[blocks.number(rows)] = max(
            _largest_chord(four[3], four[i], defined[:, 3] & defined[:, i]) for i in range(3)
        )
        if loop_points is not None:
            loop_corners = [gather(loop_points, vertex) for vertex in six]
            for child, normal in zip(CHILDREN, four, strict=True):
                counterpart = triangle_normals(*(loop_corners[i] for i in child))
                flipped[rows] += dot(counterpart, normal) < 0

    blocks.run(len(topology.faces), look_inside)
    normals, defined = normals.reshape(-1, 3), has_area.reshape(-1)
    across = np.zeros(blocks.count(len(topology.interior)))

    def look_across(rows: slice) -> None:
        pairs = children_across(topology, topology.interior[rows])
        across[blocks.number(rows)] = max(
            _largest_chord(
                gather(normals, one), gather(normals, other), defined[one] & defined[other]
            )
            for one, other in pairs.transpose(0, 2, 1)
        )

    blocks.run(len(topology.interior), look_across)
    chord = np.sqrt(max(inside.max(initial=0), across.max(initial=0)))
    # The chord keeps small angles that 1 − cos would round away.
    return ChildFaces(normals, int(flipped.sum()), float(2 * np.arcsin(min(1.0, chord / 2))))


def _largest_chord(
    n1: Float[np.ndarray, "N 3"], n2: Float[np.ndarray, "N 3"], defined: Bool[np.ndarray, " N"]
) -> float:
    """The largest squared distance between the normals of a pair that both have one."""
    chord = n1 - n2
    return float(np.max(dot(chord, chord), initial=0, where=defined))


def level_report(
    topology: Topology, vertices: Placement, edges: Placement, children: ChildFaces
) -> LevelReport:
    """Summarise the step that refined ``topology``."""
    interior = topology.interior
    classes = np.bincount(topology.edge_class, minlength=len(EdgeClass))
    counts: EdgeCounts = {
        "interior": int(classes[EdgeClass.INTERIOR]),
        "boundary": int(classes[EdgeClass.BOUNDARY]),
        "irregular": int(classes[EdgeClass.IRREGULAR]),
    }
    if classes[EdgeClass.CREASE]:
        counts["crease"] = int(classes[EdgeClass.CREASE])
    report: LevelReport = {
        "vertices": topology.vertex_count + len(topology.edges),
        "faces": 4 * len(topology.faces),
        "edges": counts,
        "degenerate_frames": int(edges.degenerate.sum() + vertices.degenerate.sum()),
        "flipped_faces": children.flipped,
        "proximity_ratio": _ratio_summary(edges.ratio[interior]),
        "gate": _gate_summary(edges.gate[interior]),
        "normal_jump_max": children.normal_jump_max,
    }
    if vertices.corrected is not None:
        report["vertex_rule"] = {
            "vertices": int(vertices.corrected.sum()),
            "proximity_ratio": _ratio_summary(vertices.ratio[vertices.corrected]),
            "gate": _gate_summary(vertices.gate[vertices.corrected]),
        }
    return report


def _ratio_summary(ratio: Float[np.ndarray, " N"]) -> RatioSummary:
    some = len(ratio) > 0
    return {
        "max": float(ratio.max(initial=0)),
        "mean": float(ratio.mean()) if some else 0.0,
        "p99": float(np.percentile(ratio, 99)) if some else 0.0,
    }


def _gate_summary(gate: Float[np.ndarray, " N"]) -> GateSummary:
    some = len(gate) > 0
    return {
        "mean": float(gate.mean()) if some else 0.0,
        "max": float(gate.max(initial=0)),
        "active": float((gate > GATE_ACTIVE).mean()) if some else 0.0,
    }
