"""Rows of arrays: equal ones, first appearances, extents; vectors, one a row."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Float, Integer, Shaped, UInt

# Points that are read as one row: down rows of three numbers numpy takes ten times as long.
FOLD = 128


def distinct_rows(rows: Shaped[np.ndarray, "N K"]) -> Integer[np.ndarray, " N"]:
    """Return a number for each row: equal rows share it, bit by bit, and only they."""
    words = as_words(rows)
    mixed = _hash(words)
    order = np.argsort(mixed)
    opens = np.empty(len(order), dtype=bool)
    opens[:1] = True
    ordered = mixed[order]
    np.not_equal(ordered[1:], ordered[:-1], out=opens[1:])
    number = np.cumsum(opens) - 1
    leader = order[np.flatnonzero(opens)]
    ids = np.empty(len(rows), dtype=np.int64)
    ids[order] = number
    if (words == words[leader[ids]]).all():
        return ids
    # Two different rows share a hash: rare, unless a file is made for it, so this may be slow.
    whole = np.ascontiguousarray(words).view(np.dtype((np.void, words.strides[0]))).reshape(-1)
    return np.unique(whole, return_inverse=True)[1].reshape(-1)


def number_by_first_appearance(
    labels: Integer[np.ndarray, " N"],
) -> tuple[Integer[np.ndarray, " N"], Integer[np.ndarray, " M"]]:
    """Rename labels ≥ 0 to 0, 1, 2, … in the order in which they first occur.

    Return them, and where each occurs first.
    """
    earliest = first_places(labels, int(labels.max(initial=-1)) + 1)
    first = np.sort(earliest[earliest >= 0])
    number = np.empty_like(earliest)
    number[labels[first]] = np.arange(len(first))
    return number[labels], first


def first_places(labels: Integer[np.ndarray, " N"], count: int) -> Integer[np.ndarray, " S"]:
    """Return where each of the labels 0 … count − 1 first occurs; −1 where it does not."""
    earliest = np.full(count, -1, dtype=np.int64)
    # Written backwards, so that the earliest occurrence is the one that remains.
    earliest[labels[::-1]] = np.arange(len(labels) - 1, -1, -1)
    return earliest


def as_words(rows: Shaped[np.ndarray, "N K"]) -> UInt[np.ndarray, "N W"]:
    """Return the rows' bits as unsigned 32-bit words, padded with zeros."""
    narrow = np.ascontiguousarray(rows)
    width = narrow.itemsize * narrow.shape[1]
    octets = narrow.view(np.uint8).reshape(len(narrow), width)
    if width % 4:
        octets = np.pad(octets, ((0, 0), (0, -width % 4)))
    return np.ascontiguousarray(octets).view(np.uint32)


def _hash(words: UInt[np.ndarray, "N W"]) -> UInt[np.ndarray, " N"]:
    """Return a 64-bit mix of each row."""
    mixed = np.full(len(words), 0x9E3779B97F4A7C15, dtype=np.uint64)
    for word in words.T:
        mixed = (mixed ^ word) * np.uint64(0xD6E8FEB86659FD93)
        mixed ^= mixed >> np.uint64(32)
    return mixed


def marked(rows: Integer[np.ndarray, "*N"], count: int) -> Bool[np.ndarray, " S"]:
    """Return which of ``count`` rows are named, however often."""
    marks = np.zeros(count, dtype=bool)
    marks[rows] = True
    return marks


def ranges(
    first: Integer[np.ndarray, " N"], counts: Integer[np.ndarray, " N"], step: int = 1
) -> Integer[np.ndarray, " M"]:
    """Return ``counts`` numbers from each of ``first`` on, one range after another."""
    before = np.cumsum(counts) - counts
    return np.repeat(first - step * before, counts) + step * np.arange(int(counts.sum()))


def ragged(
    offsets: Integer[np.ndarray, " N1"], rows: Integer[np.ndarray, " K"]
) -> tuple[Integer[np.ndarray, " M"], Integer[np.ndarray, " K1"]]:
    """Return the places of some rows of ragged rows, and where each then begins."""
    counts = np.diff(offsets)[rows]
    return ranges(offsets[rows], counts), np.append(0, np.cumsum(counts))


def extent(
    points: Float[np.ndarray, "N K"],
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Return the least and the largest of each coordinate of N ≥ 1 points, in their precision."""
    return _reduced(np.minimum, points), _reduced(np.maximum, points)


def _reduced(by: np.ufunc, points: Float[np.ndarray, "N K"]) -> Float[np.ndarray, " K"]:
    whole = len(points) - len(points) % FOLD
    if whole:
        folded = by.reduce(points[:whole].reshape(-1, FOLD * points.shape[1]), axis=0)
        points = np.concatenate([folded.reshape(FOLD, -1), points[whole:]])
    return by.reduce(points, axis=0)


def disjoint_faces(parts: Iterable[tuple[np.ndarray, int]]) -> Integer[np.ndarray, "F 3"]:
    """Return the faces of several meshes as one; the vertices of each follow those before it.

    Args:
        parts: of each mesh its (F, 3) faces and the count of its vertices; at least one.
    """
    shifted: list[np.ndarray] = []
    start = 0
    for faces, vertex_count in parts:
        # Not in the parts' own type, in which the sum may not fit.
        shifted.append(faces.astype(np.int64) + start)
        start += vertex_count
    return np.concatenate(shifted)


# --- vectors --------------------------------------------------------------------------------------


def dot(u: Float[np.ndarray, "*#N 3"], v: Float[np.ndarray, "*#N 3"]) -> Float[np.ndarray, "*#N"]:
    """Return the inner products of vectors, summed in a fixed order."""
    return u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]


def cross(u: Float[np.ndarray, "N 3"], v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Return the cross products of rows (written out: np.cross spends most time on axes)."""
    return np.stack(
        [
            u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
            u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
            u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
        ],
        axis=-1,
    )


def norm(v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return the lengths of rows; 0 for NaN."""
    square = dot(v, v)
    return np.sqrt(np.where(square > 0, square, 0.0))


def unit(v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Scale rows to length 1; zero rows stay zero."""
    length = norm(v)
    # Divide, not multiply by the inverse: on an axis-aligned plane z / √(z²) is exactly 1.
    return v / np.where(length > 0, length, np.inf)[:, None]
