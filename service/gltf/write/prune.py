"""Remove replaced geometry from a file: accessors, buffer views and bytes; count lost vertices.

New entries take the numbers of old ones, so that other numbers (in animations, skins, images) stay.
Data that was unused before stays.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from pns_common.mesh.rows import marked

from ..read.extensions import References, accessor_references, view_references
from ..read.plan import Spare
from ..read.primitives import TrianglePrimitive
from ..read.schema import Document

# Start of the cut after the last.
NEVER = sys.maxsize


def remove_unused(tree: dict[str, Any], spare: Spare) -> list[tuple[int, int]]:
    """Remove unused spare accessors and views from the tree; return (start, end) of these views.

    All buffers have been joined: each view lies in buffer 0, or is compressed.
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
    """Return the entries without references among the spare and the new ones."""
    unused = {*spare, *range(old, count)}
    for holders, key in references:
        unused.difference_update([holder.get(key) for holder in holders])
    return sorted(unused)


def _renumbered(
    entries: list[dict[str, Any]], unused: list[int], references: Iterable[References]
) -> list[dict[str, Any]]:
    """Return entries without the unused; the last ones take the free numbers."""
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
    """Cut the bytes in `gone` and not in `needed` from the pieces; both are starts and ends.

    Whole words are cut, so that the rest stays aligned. Also returns (end, bytes removed so far) of
    each cut, ascending, for `moved`.
    """
    cuts = _cuts(gone, needed) if len(gone) else []
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
    """Return the offsets of bytes after the cuts."""
    ends, removed = np.array([(0, 0), *shifts], dtype=np.int64).T
    before = np.array(offsets, dtype=np.int64)
    after: list[int] = (before - removed[np.searchsorted(ends, before, side="right") - 1]).tolist()
    return after


def _cuts(gone: Int[np.ndarray, "N 2"], needed: Int[np.ndarray, "M 2"]) -> list[tuple[int, int]]:
    """Return the runs of words of which every byte is in `gone` and none in `needed`."""
    first = int(gone.min()) // 4 * 4
    kept = np.ones(int(gone.max()) - first, dtype=bool)
    for ranges, keeps in ((gone, False), (needed, True)):
        for start, end in np.maximum(ranges - first, 0).tolist():
            kept[start:end] = keeps
    words = kept[: len(kept) // 4 * 4].reshape(-1, 4).any(axis=1)
    turns = first + 4 * np.flatnonzero(np.diff(words, prepend=True, append=True))
    return list(zip(turns[::2].tolist(), turns[1::2].tolist(), strict=True))


@dataclass
class VertexUse:
    """Elements of POSITION accessors that refined faces use; primitives may share accessors."""

    document: Document
    rows: defaultdict[int, list[Int[np.ndarray, " N"]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    refined: set[tuple[int, int]] = field(default_factory=set)

    def add(
        self,
        mesh: int,
        primitives: Sequence[TrianglePrimitive],
        kept: Sequence[Bool[np.ndarray, " F"]],
    ) -> None:
        """Add the refined primitives of a mesh; `kept` are their refined faces."""
        for primitive, keep in zip(primitives, kept, strict=True):
            if keep.any():
                source = self.document.meshes[mesh].primitives[primitive.number]
                self.refined.add((mesh, primitive.number))
                rows = primitive.rows
                # All rows of a primitive are used by its faces.
                if not keep.all():
                    rows = rows[marked(primitive.corners[keep].reshape(-1), len(rows))]
                self.rows[source.attributes["POSITION"]].append(rows)

    def unused(self) -> int:
        """Count elements without a refined face, of accessors that only refined primitives use."""
        others = {
            primitive.attributes["POSITION"]
            for mesh, content in enumerate(self.document.meshes)
            for number, primitive in enumerate(content.primitives)
            if (mesh, number) not in self.refined and "POSITION" in primitive.attributes
        }
        return sum(
            self.document.accessors[accessor].count - _count_distinct(rows)
            for accessor, rows in self.rows.items()
            if accessor not in others
        )


def _count_distinct(rows: Sequence[Int[np.ndarray, " N"]]) -> int:
    """Count distinct rows of several ascending lists."""
    # np.unique takes several times as long.
    ordered = rows[0] if len(rows) == 1 else np.sort(np.concatenate(rows))
    return 1 + int(np.count_nonzero(ordered[1:] != ordered[:-1]))
