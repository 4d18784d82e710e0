"""Report entries: changes beside the geometry, and what a viewer may stumble over."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.mesh.normals import opposed_corners
from pns_common.mesh.rows import dot, extent
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks, available_threads

from ...changes import Change, counted
from ...meshes.weld import near_labels
from ..read.primitives import TrianglePrimitive
from .attributes import RefinedPrimitive
from .normals import border_vertices

# In units of R; exporters that transform both sides of a seam apart leave less between them.
NEAR = 1e-5
# Nearer than so many times its own size a surface is not looked at: its sides would have to be some
# ten thousandths of that.
FAR = 10
# Fewer steps to a side show: half of one is half a degree.
STEPS = 100


def near_misses(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    lengths: Sequence[float],
    part: Int[np.ndarray, " V"] | None = None,
) -> list[int]:
    """Count the border vertices of each part that lie within NEAR of another.

    `lengths` are the parts' own R. `part` is the part of each vertex; None: the mesh is one part.
    """
    counts = np.zeros(len(lengths), dtype=np.int64)
    border = np.flatnonzero(border_vertices(topology))
    if not len(border):
        return counts.tolist()
    whose = np.zeros(len(border), dtype=np.int64) if part is None else part[border]
    order = np.argsort(whose, kind="stable")
    border, whose = border[order], whose[order]
    owners, first = np.unique(whose, return_index=True)
    distance = NEAR * np.array(lengths, dtype=np.float64)[owners]
    labels = near_labels(points[border], distance, whose, first)
    shared = np.bincount(labels)[labels] > 1
    np.add.at(counts, whose[shared], 1)
    return counts.tolist()


def near_miss_changes(count: int, pointer: str) -> list[Change]:
    """Return the report's entry on border vertices that nearly meet, in the mesh at `pointer`."""
    return counted({"near-misses": count}, pointer)


def changes_of_primitive(
    primitive: TrianglePrimitive, kept: Bool[np.ndarray, " F"], levels: int, pointer: str
) -> list[Change]:
    """Return the dropped faces of a primitive of the mesh at `pointer`, and those too far away."""
    pointer = f"{pointer}/primitives/{primitive.number}"
    if not kept.any():
        return [Change(pointer, "left-as-it-was", len(kept))]
    dropped = int((~kept).sum())
    faces = primitive.corners if dropped == 0 else primitive.corners[kept]
    far = 0
    if not primitive.is_double:
        far = faces_too_far(primitive.attributes["POSITION"], faces, levels)
    return counted({"degenerate-faces": dropped, ("too-far", str(STEPS)): far}, pointer)


def changes_of_vertices(near: int, cut: int, lost: float, pointer: str) -> list[Change]:
    """Return the number of joined vertices of a mesh, and of refined ones that lost a joint.

    `lost` is the largest share of a vertex's weight that its lost joints had.
    """
    percent = ceil(100 * lost)
    light = "light-joints-cut" if percent == 1 else ("joints-cut", str(percent))
    return counted({"joined": near, light: cut}, pointer)


def opposed_normals(refined: Sequence[RefinedPrimitive], pointer: str) -> list[Change]:
    """Return how many normals of each primitive of the mesh at `pointer` oppose their face."""
    blocks = Blocks(available_threads())
    counts = {
        part.source.number: int(
            opposed_corners(
                part.attributes["POSITION"], part.attributes["NORMAL"], part.faces, blocks
            ).sum()
        )
        for part in refined
        if "NORMAL" in part.attributes
    }
    return [
        Change(f"{pointer}/primitives/{number}", "opposed-normals", count)
        for number, count in counts.items()
        if count
    ]


def faces_too_far(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], levels: int = 0
) -> int:
    """Count the faces whose longest side has fewer than ``STEPS`` steps of float32.

    They are those of a surface that will be refined so many levels more. A survey's coordinates are
    millions of metres, where float32 has steps of half a metre: a surface comes out as stairs.
    """
    low, high = (bound.astype(np.float64) for bound in extent(points))
    largest = max(-low.min(), high.max())
    if largest <= FAR * (high - low).max():
        return 0
    longest = np.zeros(len(faces))
    for corner in range(3):
        side = points[faces[:, corner]].astype(np.float64) - points[faces[:, corner - 1]]
        np.maximum(longest, dot(side, side), out=longest)
    shortest = STEPS * float(np.spacing(np.float32(largest))) * 2**levels
    return int((longest < shortest**2).sum()) * 4**levels
