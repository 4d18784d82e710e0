"""Which rows of an array are equal, bit by bit, and which of them come first."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, Shaped, UInt


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
    earliest = first_places(labels, int(labels.max(initial=-1)) + 1)
    first = np.sort(earliest[earliest >= 0])
    number = np.empty_like(earliest)
    number[labels[first]] = np.arange(len(first))
    return number[labels], first


def first_places(labels: Int[np.ndarray, " N"], count: int) -> Int[np.ndarray, " S"]:
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
