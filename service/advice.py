"""Say why a refinement changed little, and which option changes that."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.mesh.creases import Creases, edge_cosines
from pns_common.mesh.mesh import Mesh
from pns_common.report import LevelReport

# Plane faces in single precision turn by less.
BENT = math.radians(0.5)
# From this share of bent edges that stay sharp on, a shape looks faceted.
MANY_SHARP = 0.5
# Degrees. The first is offered that keeps at most this share of what stays sharp now.
ANGLES = range(40, 180, 20)
FEWER = 0.5
# From this share of borders on, faces do not hang together.
MOST_OPEN = 0.9


@dataclass(frozen=True)
class Bends:
    """Number of bent edges of a control mesh, of those kept sharp, of those beyond each angle."""

    bent: int = 0
    sharp: int = 0
    steep: tuple[int, ...] = (0,) * len(ANGLES)

    def __add__(self, other: Bends) -> Bends:
        """Count the edges of both."""
        steep = tuple(map(operator.add, self.steep, other.steep))
        return Bends(self.bent + other.bent, self.sharp + other.sharp, steep)


NO_BENDS = Bends()


def count_bends(
    mesh: Mesh, creases: Creases, parts: int = 1, part_of_face: Int[np.ndarray, " F"] | None = None
) -> list[Bends]:
    """Count the bent edges of each part of a mesh, and the sharp ones among them.

    Without `part_of_face` the mesh is one part. Nothing is counted where no sharp edges are asked
    for.
    """
    if creases.named is None:
        return [NO_BENDS] * parts
    topology = mesh.topology()
    cosines = edge_cosines(mesh.vertices, topology)
    bent = np.flatnonzero(cosines < math.cos(BENT))
    steep = [cosines[bent] < math.cos(math.radians(angle)) for angle in ANGLES]
    sharp = creases.applied_by_name(topology).is_sharp[bent]
    part = np.zeros(len(bent), dtype=np.int64)
    if part_of_face is not None:
        part = part_of_face[topology.half_edges[bent, 0] // 3]
    counts = [
        np.bincount(part[chosen], minlength=parts).tolist() for chosen in (..., sharp, *steep)
    ]
    return [Bends(bent, sharp, tuple(steep)) for bent, sharp, *steep in zip(*counts, strict=True)]


def advice_on(levels: Sequence[LevelReport], bends: Bends) -> list[str]:
    """Return the reasons why a shape changed little, each with the option to set."""
    if not levels:
        return []
    edges = levels[0]["edges"]
    creases = edges.get("crease", 0)
    total = creases + sum(edges[kind] for kind in ("interior", "boundary", "irregular"))
    if bends.bent and bends.sharp >= MANY_SHARP * bends.bent:
        kept = f"{bends.sharp:,} of {bends.bent:,} bent edges are kept sharp: use"
        for angle, steep in zip(ANGLES, bends.steep, strict=True):
            if 0 < steep <= FEWER * bends.sharp:
                return [f"{kept} crease=angle:{angle}, which keeps {steep:,}, for a rounder shape"]
        touching = edges["boundary"] or edges["irregular"]
        risk = "; gaps may open where pieces touch" if touching else ""
        return [f"{kept} crease=off to round all of them{risk}"]
    if edges["boundary"] >= MOST_OPEN * total and not _is_one_face(levels[0]):
        return [
            f"{edges['boundary']:,} of {total:,} edges are open borders, and faces that only touch "
            "stay apart: use weld_tolerance=0.001 to join vertices that nearly coincide"
        ]
    if levels[-1]["normal_jump_max"] < BENT and not creases and not edges.get("soft"):
        return ["the shape is flat: refining adds faces and rounds outlines, nothing else"]
    return []


def _is_one_face(level: LevelReport) -> bool:
    """Return whether a level refined a single face, which has no other to be joined with.

    A triangle becomes four, with three new vertices; a polygon of n corners n quads, with n + 1.
    """
    border = level["edges"]["boundary"]
    return level["faces"] in (4, border) and level["vertices"] <= 2 * border + 1
