"""Geometry that refinement has replaced leaves the file: accessors, buffer views and bytes.

New entries take the places of old ones, so that numbers elsewhere (animations, skins, images) stay
as they were. What the file carried without use stays too: it was not ours to judge.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence, Set
from typing import Any

import numpy as np
from jaxtyping import Int

from ..read.index_references import References, accessor_references, view_references
from ..read.spare import Spare

# Where no cut starts.
NEVER = sys.maxsize


def remove_unused(tree: dict[str, Any], spare: Spare) -> list[tuple[int, int]]:
    """Take unused spare accessors and views out of the tree; (start, end) of views that went.

    All buffers have been joined: every view lies in buffer 0, or is compressed.
    """
    accessors = tree.get("accessors", [])
    named = accessor_references(tree)
    unused = _unused(named, len(accessors), spare.accessors, spare.accessor_count)
    tree["accessors"] = _renumbered(accessors, unused, accessor_references(tree))

    views = tree.get("bufferViews", [])
    named = view_references(tree, tree["accessors"])
    unused = _unused(named, len(views), spare.views, spare.view_count)
    gone = [views[index] for index in unused]
    named = view_references(tree, tree["accessors"])
    tree["bufferViews"] = _renumbered(views, unused, named)
    for key in ("accessors", "bufferViews"):
        if not tree[key]:
            del tree[key]
    return [
        (view.get("byteOffset", 0), view.get("byteOffset", 0) + view["byteLength"]) for view in gone
    ]


def _unused(references: Iterable[References], count: int, spare: Set[int], old: int) -> list[int]:
    """Return which of ``count`` entries nothing names, of spare ones and those that are not old."""
    unused = {*spare, *range(old, count)}
    for holders, key in references:
        unused.difference_update([holder.get(key) for holder in holders])
    return sorted(unused)


def _renumbered(
    entries: list[dict[str, Any]], unused: list[int], references: Iterable[References]
) -> list[dict[str, Any]]:
    """Leave entries out: the last ones move into the places of those that went."""
    count, gone = len(entries) - len(unused), set(unused)
    holes = [index for index in unused if index < count]
    movers = [index for index in range(count, len(entries)) if index not in gone]
    place = dict(zip(movers, holes, strict=True))
    result = entries[:count]
    for old, new in place.items():
        result[new] = entries[old]
    for holders, key in references:
        for holder in holders:
            if holder.get(key) in place:
                holder[key] = place[holder[key]]
    return result


def cut(
    pieces: Sequence[bytes | memoryview],
    gone: Int[np.ndarray, "N 2"],
    needed: Int[np.ndarray, "M 2"],
) -> tuple[list[bytes | memoryview], list[tuple[int, int]]]:
    """Cut from the pieces the bytes of `gone` that nothing in `needed` covers.

    Both are starts and ends. Whole words go, so that what follows stays aligned. Also the
    (position, bytes before it that went) of each cut, ascending, for `moved`.
    """
    cuts = [
        (start + -start % 4, end - end % 4)
        for start, end in _without(_merged(gone), _merged(needed))
        if end - end % 4 > start + -start % 4
    ]
    result: list[bytes | memoryview] = []
    shifts: list[tuple[int, int]] = []
    removed, position, upcoming = 0, 0, iter([*cuts, (NEVER, NEVER)])
    start, end = next(upcoming)
    for piece in pieces:
        data, offset = memoryview(piece), 0
        while start < position + len(data):
            lower, upper = max(start - position, 0), min(end - position, len(data))
            if lower > offset:
                result.append(data[offset:lower])
            offset = upper
            if end > position + len(data):
                break
            removed += end - start
            shifts.append((end, removed))
            start, end = next(upcoming)
        if offset < len(data):
            result.append(data[offset:] if offset else piece)
        position += len(data)
    return result, shifts


def moved(offsets: Sequence[int], shifts: Sequence[tuple[int, int]]) -> list[int]:
    """Return where bytes lie after the cuts."""
    ends, removed = np.array([(0, 0), *shifts], dtype=np.int64).T
    before = np.array(offsets, dtype=np.int64)
    after: list[int] = (before - removed[np.searchsorted(ends, before, side="right") - 1]).tolist()
    return after


def _merged(ranges: Int[np.ndarray, "N 2"]) -> list[tuple[int, int]]:
    """Return ascending ranges that do not touch, which cover the same."""
    starts, ends = ranges.T
    order = np.argsort(starts)
    starts, ends = starts[order], np.maximum.accumulate(ends[order])
    opens, closes = (np.ones(len(starts), dtype=bool) for _ in range(2))
    opens[1:] = closes[:-1] = starts[1:] > ends[:-1]
    return list(zip(starts[opens].tolist(), ends[closes].tolist(), strict=True))


def _without(ranges: list[tuple[int, int]], others: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return what is left of disjoint ascending ranges without others of the same kind."""
    left: list[tuple[int, int]] = []
    place = 0
    for start, end in ranges:
        while place < len(others) and others[place][1] <= start:
            place += 1
        index = place
        while index < len(others) and others[index][0] < end:
            if others[index][0] > start:
                left.append((start, others[index][0]))
            start = max(start, others[index][1])
            index += 1
        if start < end:
            left.append((start, end))
    return left
