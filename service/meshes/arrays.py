"""Small functions of arrays: rows, vectors, bounds and labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.distinct import as_words, distinct_rows, number_by_first_appearance

__all__ = [
    "as_words",
    "cross",
    "disjoint_faces",
    "distinct_rows",
    "dot",
    "extent",
    "marked",
    "norm",
    "number_by_first_appearance",
    "slices",
    "unit",
]

# numpy takes ten times as long along three columns as along 384.
FOLD = 128


def marked(rows: Int[np.ndarray, " N"], count: int) -> Bool[np.ndarray, " S"]:
    """Return a mask of `count` rows, true at the given ones."""
    marks = np.zeros(count, dtype=bool)
    marks[rows] = True
    return marks


def slices(lengths: Sequence[int]) -> list[slice]:
    """Return consecutive slices of the given lengths."""
    ends = np.cumsum([0, *lengths]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]


def disjoint_faces(parts: Iterable[tuple[Int[np.ndarray, "f 3"], int]]) -> Int[np.ndarray, "F 3"]:
    """Return the faces of a disjoint union of meshes, given by faces and number of vertices."""
    shifted: list[np.ndarray] = []
    start = 0
    for faces, vertex_count in parts:
        # The sum may exceed the type of the faces.
        shifted.append(faces.astype(np.int64) + start)
        start += vertex_count
    return np.concatenate(shifted)


def dot(u: Float[np.ndarray, "*N 3"], v: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
    """Return inner products, summed in a fixed order."""
    return u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]


def cross(u: Float[np.ndarray, "N 3"], v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Return cross products; np.cross takes several times as long."""
    return np.stack(
        [
            u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
            u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
            u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
        ],
        axis=-1,
    )


def norm(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return the lengths of vectors."""
    return np.sqrt(dot(vectors, vectors))


def unit(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Return vectors of length 1; zeros stay zeros."""
    length = norm(vectors)
    # Dividing, unlike multiplying by the inverse, makes unit vectors along axes exact.
    return vectors / np.where(length > 0, length, np.inf)[:, None]


def extent(
    points: Float[np.ndarray, "N K"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Return the lower and upper bounds of N ≥ 1 points, in their precision."""
    return _reduced(np.minimum, points), _reduced(np.maximum, points)


def _reduced(by: np.ufunc, points: Float[np.ndarray, "N K"]) -> Float[np.ndarray, " K"]:
    whole = len(points) - len(points) % FOLD
    if whole:
        folded = by.reduce(points[:whole].reshape(-1, FOLD * points.shape[1]), axis=0)
        points = np.concatenate([folded.reshape(FOLD, -1), points[whole:]])
    return by.reduce(points, axis=0)
