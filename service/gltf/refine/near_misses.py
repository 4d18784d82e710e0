"""Seams that do not quite meet: border vertices that lie nearer to another than anybody sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from pns_common.mesh import Mesh

from ...meshes.weld_tolerance import near_labels
from ...report import Change
from .own_normals import border_vertices

# In units of R; exporters that transform both sides of a seam apart leave less between them.
NEAR = 1e-5


def near_misses(
    mesh: Mesh, lengths: Sequence[float], part: Int[np.ndarray, " V"] | None = None
) -> list[int]:
    """Count the border vertices of each part that lie within NEAR of another.

    `lengths` are the parts' own R; `part` says whose the vertices are, part by part, and None that
    all are of one.
    """
    counts = np.zeros(len(lengths), dtype=np.int64)
    border = np.flatnonzero(border_vertices(mesh))
    if not len(border):
        return counts.tolist()
    whose = np.zeros(len(border), dtype=np.int64) if part is None else part[border]
    order = np.argsort(whose, kind="stable")
    border, whose = border[order], whose[order]
    owners, first = np.unique(whose, return_index=True)
    distance = NEAR * np.array(lengths, dtype=np.float64)[owners]
    labels = near_labels(mesh.vertices[border], distance, whose, first)
    shared = np.bincount(labels)[labels] > 1
    np.add.at(counts, whose[shared], 1)
    return counts.tolist()


def change_of(count: int, pointer: str) -> list[Change]:
    """Return what is reported of so many near misses of the mesh at `pointer`."""
    what = "border vertices lie within 1e-5 R of another: weld_tolerance joins them"
    return [Change(pointer, what, count)] if count else []
