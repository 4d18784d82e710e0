"""Measured numbers of one step: proximity ratio, gate use, flipped faces, normal jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from jaxtyping import Float, Int

from pns_common.arrays import cross, dot, gather
from pns_common.blocks import Blocks
from pns_common.frames import face_normals
from pns_common.schemes import Placement
from pns_common.topology import EdgeClass, Topology, child_face_pairs

# A gate above this counts as active.
GATE_ACTIVE = 0.01


class EdgeCounts(TypedDict):
    """The edges that a level refined, by class."""

    interior: int
    boundary: int
    irregular: int


class RatioSummary(TypedDict):
    """Proximity ratio ‖δ‖ / (C h²) over the level's interior edges; never above 1."""

    max: float
    mean: float
    p99: float


class GateSummary(TypedDict):
    """Gate γ over the level's interior edges; ``active`` is the share above 0.01."""

    mean: float
    max: float
    active: float


class LevelReport(TypedDict):
    """One level: counts of the mesh it made and diagnostics of the step that made it."""

    vertices: int
    faces: int
    edges: EdgeCounts
    degenerate_frames: int
    flipped_faces: int
    proximity_ratio: RatioSummary
    gate: GateSummary
    normal_jump_max: float


@dataclass(frozen=True, eq=False)
class ChildFaces:
    """The faces that a step made: unit normals, and how many oppose their Loop counterpart."""

    normals: Float[np.ndarray, "F 3"]
    flipped: int


def child_faces(
    points: Float[np.ndarray, "V 3"],
    displacement: Float[np.ndarray, "V 3"] | None,
    faces: Int[np.ndarray, "F 3"],
    blocks: Blocks,
) -> ChildFaces:
    """Normals of refined faces; a face is flipped if its normal opposes that of Loop's face.

    ``displacement`` is what the points stand away from Loop's, None if nothing.
    """
    normals = np.empty((len(faces), 3))
    flipped = np.zeros(len(faces), dtype=bool)

    def block(rows: slice) -> None:
        normals[rows] = face_normals(points, faces[rows])
        if displacement is None:
            return
        a, b, c = (
            gather(points, faces[rows, i]) - gather(displacement, faces[rows, i]) for i in range(3)
        )
        flipped[rows] = dot(cross(b - a, c - a), normals[rows]) < 0

    blocks.run(len(faces), block)
    return ChildFaces(normals, int(flipped.sum()))


def normal_jump_max(
    normals: Float[np.ndarray, "F 3"], pairs: Int[np.ndarray, "P 2"], blocks: Blocks
) -> float:
    """Largest angle (radians, 0 … π) between the normals of faces that share an interior edge.

    Faces without area have no normal and are left out.
    """
    largest = np.zeros(-(-len(pairs) // blocks.rows))

    def block(rows: slice) -> None:
        n1, n2 = gather(normals, pairs[rows, 0]), gather(normals, pairs[rows, 1])
        defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
        chord = n1 - n2
        largest[rows.start // blocks.rows] = np.max(dot(chord, chord), initial=0, where=defined)

    blocks.run(len(pairs), block)
    # The chord keeps small angles that 1 − cos would round away.
    return float(2 * np.arcsin(min(1.0, np.sqrt(largest.max(initial=0)) / 2)))


def level_report(
    topology: Topology,
    vertices: Placement,
    edges: Placement,
    children: ChildFaces,
    blocks: Blocks,
) -> LevelReport:
    """Summarise the step that refined ``topology``."""
    interior = topology.interior
    classes = np.bincount(topology.edge_class, minlength=len(EdgeClass))
    corrected = len(interior) > 0
    ratio, gate = edges.ratio[interior], edges.gate[interior]
    return {
        "vertices": topology.vertex_count + len(topology.edges),
        "faces": 4 * len(topology.faces),
        "edges": {
            "interior": int(classes[EdgeClass.INTERIOR]),
            "boundary": int(classes[EdgeClass.BOUNDARY]),
            "irregular": int(classes[EdgeClass.IRREGULAR]),
        },
        "degenerate_frames": int(edges.degenerate.sum() + vertices.degenerate.sum()),
        "flipped_faces": children.flipped,
        "proximity_ratio": {
            "max": float(ratio.max(initial=0)),
            "mean": float(ratio.mean()) if corrected else 0.0,
            "p99": float(np.percentile(ratio, 99)) if corrected else 0.0,
        },
        "gate": {
            "mean": float(gate.mean()) if corrected else 0.0,
            "max": float(gate.max(initial=0)),
            "active": float((gate > GATE_ACTIVE).mean()) if corrected else 0.0,
        },
        "normal_jump_max": normal_jump_max(children.normals, child_face_pairs(topology), blocks),
    }
