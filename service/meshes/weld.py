"""Weld: join by position what a file format splits at its seams.

Formats store one vertex for each distinct set of attributes, so a UV seam or a hard edge looks like
a boundary, and refining that mesh would crack it. Every format is therefore welded by exact
position first, in the precision that the file stores (float32 in glTF and STL, double in OBJ and
OFF, either in PLY); attributes stay with the corners. What would move two vertices apart later
(morph deltas, a skin binding) keeps them apart here: closed lips are two lips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped


@dataclass(frozen=True, eq=False)
class Weld:
    """A welded mesh.

    Attributes:
        points: (V, 3) positions of the welded vertices.
        faces: (F, 3) welded vertices, numbered by first appearance over these corners.
        vertex_of: (N,) the welded vertex of each file vertex; −1 where no face uses it.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    vertex_of: Int[np.ndarray, " N"]


def weld(
    positions: Float[np.ndarray, "N 3"],
    faces: Int[np.ndarray, "F 3"],
    movement: Int[np.ndarray, " N"] | None = None,
) -> Weld:
    """Join the vertices whose positions are equal (−0 = 0), whatever lies near them.

    `movement` labels what else must be equal; None where nothing else moves a vertex.
    """
    positions = canonical_zero(positions)
    labels = distinct_rows(positions)
    if movement is not None:
        labels = distinct_rows(np.column_stack([labels, movement]))
    return weld_by_label(positions, faces, labels)


def weld_by_label(
    positions: Float[np.ndarray, "N 3"],
    faces: Int[np.ndarray, "F 3"],
    labels: Int[np.ndarray, " N"],
) -> Weld:
    """Join the vertices that share a label, at the position of the first corner of each."""
    flat = faces.reshape(-1)
    group, first = number_by_first_appearance(labels[flat])
    points = np.take(positions, flat[first], axis=0).astype(np.float64)
    vertex_of = np.full(len(positions), -1, dtype=np.int64)
    vertex_of[flat] = group
    return Weld(points=points, faces=group.reshape(-1, 3), vertex_of=vertex_of)


def canonical_zero(values: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Write −0 as 0, so that equal numbers have equal bits."""
    return values + values.dtype.type(0)


def distinct_rows(rows: Shaped[np.ndarray, "N K"]) -> Int[np.ndarray, " N"]:
    """Give the rows numbers: equal ones, and only they, share one; compared bit by bit."""
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
    labels: Int[np.ndarray, " N"],
) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, " M"]]:
    """Rename non-negative labels 0, 1, 2, … in the order in which they first occur.

    Return them, and where each occurs first.
    """
    earliest = np.full(int(labels.max(initial=-1)) + 1, -1, dtype=np.int64)
    # Written backwards, so that the earliest occurrence is the one that remains.
    earliest[labels[::-1]] = np.arange(len(labels) - 1, -1, -1)
    first = np.sort(earliest[earliest >= 0])
    number = np.empty_like(earliest)
    number[labels[first]] = np.arange(len(first))
    return number[labels], first


def as_words(rows: Shaped[np.ndarray, "N K"]) -> Int[np.ndarray, "N W"]:
    """Return the rows' bits as unsigned 32-bit words, padded with zeros."""
    narrow = np.ascontiguousarray(rows)
    width = narrow.itemsize * narrow.shape[1]
    octets = narrow.view(np.uint8).reshape(len(narrow), width)
    if width % 4:
        octets = np.pad(octets, ((0, 0), (0, -width % 4)))
    return np.ascontiguousarray(octets).view(np.uint32)


def _hash(words: Int[np.ndarray, "N W"]) -> Int[np.ndarray, " N"]:
    """Return a 64-bit mix of each row."""
    mixed = np.full(len(words), 0x9E3779B97F4A7C15, dtype=np.uint64)
    for word in words.T:
        mixed = (mixed ^ word) * np.uint64(0xD6E8FEB86659FD93)
        mixed ^= mixed >> np.uint64(32)
    return mixed
