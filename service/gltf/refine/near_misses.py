"""Seams that do not quite meet: border vertices closer to another than the eye can tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from pns_common.topology import Topology

from ...meshes.weld_tolerance import near_labels
from ...report import Change
from .normals import border_vertices

# In units of R; exporters that transform both sides of a seam apart leave less between them.
NEAR = 1e-5


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
    what = "border vertices lie within 1e-5 R of another"
    return [Change(pointer, what, count)] if count else []
