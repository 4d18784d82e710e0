"""Say where the result is in doubt, or why little changed, and which option changes that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.mesh.creases import Creases, edge_cosines
from pns_common.mesh.mesh import Mesh
from pns_common.report import LevelReport

from .changes import Advice
from .options import Options

# Plane faces in single precision turn by less.
BENT = math.radians(0.5)
# Degrees: facets of a round shape rarely bend by more than the first, or by the second at all.
STEEP, STEEPEST = 40, 60
# Options that help, as HTTP spells them.
ROUND, CRISP, WELD = "crease=off", f"crease=angle:{STEEP}", "weld_tolerance=0.001"
# A weight between these is neither sharp nor smooth.
UNDECIDED = 0.2, 0.8
# Doubt is spoken of from this many edges on, if they are this share of the steep ones.
MANY, SHARE = 10, 0.5
# The share of bent edges that bend most from which on a shape without a sharp edge looks wrong.
CRUMBLES = 0.1
# From this share of borders on, faces do not hang together.
MOST_OPEN = 0.9


@dataclass(frozen=True)
class Bends:
    """Number of bent edges of control meshes whose sharp edges were to be found.

    Attributes:
        steep, undecided: those above STEEP degrees, and those of them that are neither sharp nor
            smooth.
        smoothed: those above STEEPEST in meshes that keep no edge though many bend so.
    """

    steep: int = 0
    undecided: int = 0
    smoothed: int = 0

    def __add__(self, other: Bends) -> Bends:
        """Count the edges of both."""
        return Bends(
            self.steep + other.steep,
            self.undecided + other.undecided,
            self.smoothed + other.smoothed,
        )


NO_BENDS = Bends()


def count_bends(
    mesh: Mesh,
    creases: Creases,
    options: Options,
    parts: int = 1,
    part_of_face: Int[np.ndarray, " F"] | None = None,
) -> list[Bends]:
    """Count the bent edges of each part of a mesh, and those of them that are in doubt.

    Without `part_of_face` the mesh is one part. Nothing is counted where the options say which
    edges are sharp, or where none was looked for.
    """
    if options.crease != "auto" or creases.named is None:
        return [NO_BENDS] * parts
    topology = mesh.topology()
    angles = np.arccos(np.clip(edge_cosines(mesh.vertices, topology), -1.0, 1.0))
    marked = creases.applied_by_name(topology)
    weight = marked.sharpness
    low, high = UNDECIDED
    bent, steep = angles > BENT, angles > math.radians(STEEP)
    kinds = (
        bent,
        bent & marked.is_sharp,
        steep,
        steep & (weight > low) & (weight < high),
        angles > math.radians(STEEPEST),
    )
    part = np.zeros(len(angles), dtype=np.int64)
    if part_of_face is not None:
        part = part_of_face[topology.half_edges[:, 0] // 3]
    counts = [np.bincount(part[kind], minlength=parts).tolist() for kind in kinds]
    return [
        Bends(steep, undecided, 0 if sharp or most < CRUMBLES * bent else most)
        for bent, sharp, steep, undecided, most in zip(*counts, strict=True)
    ]


def advice_on(levels: Sequence[LevelReport], bends: Bends) -> list[Advice]:
    """Return what is in doubt, or why little changed, each with the option to set."""
    if not levels:
        return []
    edges = levels[0]["edges"]
    total = sum(edges.get(kind, 0) for kind in ("interior", "boundary", "irregular", "crease"))
    if bends.smoothed >= MANY:
        told = (
            f"no edge is kept sharp where {bends.smoothed:,} bend by more than {STEEPEST} degrees: "
            f"use {CRISP} for flat sides with crisp edges"
        )
        return [Advice(told, (CRISP,))]
    if bends.undecided >= max(MANY, SHARE * bends.steep):
        told = (
            f"{bends.undecided:,} of {bends.steep:,} steep edges are neither clearly sharp nor "
            f"clearly round: use {ROUND} for a body that is round throughout, or {CRISP} for flat "
            "sides with crisp edges"
        )
        return [Advice(told, (ROUND, CRISP))]
    if edges["boundary"] >= MOST_OPEN * total and not _is_one_face(levels[0]):
        told = (
            f"{edges['boundary']:,} of {total:,} edges are open borders, and faces that only touch "
            f"stay apart: use {WELD} to join vertices that nearly coincide"
        )
        return [Advice(told, (WELD,))]
    flat = levels[-1]["normal_jump_max"] < BENT
    if flat and not edges.get("crease") and not edges.get("soft"):
        return [Advice("the shape is flat: refining adds faces and rounds outlines, nothing else")]
    return []


def _is_one_face(level: LevelReport) -> bool:
    """Return whether a level refined a single face, which has no other to be joined with.

    A triangle becomes four, with three new vertices; a polygon of n corners n quads, with n + 1.
    """
    border = level["edges"]["boundary"]
    return level["faces"] in (4, border) and level["vertices"] <= 2 * border + 1
