"""Make a control mesh of a file's triangles, outside memory: what `pns subdivide` makes of them.

Vertices of one position become one (−0 = 0), numbered by first appearance over the corners; then
faces with a repeated vertex, all but the first of those with the same three, and vertices that no
face uses are dropped. Equal positions, and equal faces, are found by dealing rows out into files by
a hash, and sorting one file at a time; of those that are alike within a block only the first is
dealt out, so that no file is large because of one position that many vertices have.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int

from pns_common.mesh import repeated_vertex

from ...errors import UnrefinableError
from ...meshes.weld import canonical_zero
from .arrays import FACES, POSITIONS, append, blocks_of, index_type, let_go, new_array, sync

# Rows a file that is sorted in memory.
SORTED = 1 << 21
MIX = np.uint64(0xD6E8FEB86659FD93)


@dataclass(frozen=True)
class Dropped:
    """How many of a file's faces and vertices the control mesh does not have."""

    degenerate_faces: int
    duplicate_faces: int
    vertices: int


def weld_outside_memory(positions: np.ndarray, faces: np.ndarray, folder: Path) -> Dropped:
    """Write the control mesh of (N, 3) positions and (F, 3) faces into ``folder``.

    Raises:
        UnrefinableError: an index out of range, or no face with three different vertices.
    """
    scratch = _Scratch(folder)
    first = _first_corners(positions, faces, scratch)
    label = _labels(positions, first, scratch)
    dropped, repeated = _repeated_faces(faces, label, scratch)
    kept = len(faces) - int(dropped.sum())
    if kept == 0:
        raise UnrefinableError("no face has three different vertices")
    place, count = _places(faces, label, dropped, scratch)
    points = new_array(folder / POSITIONS, (count, 3), "<f8")
    corners = faces.reshape(-1)
    for rows in blocks_of(len(place)):
        shown = np.flatnonzero(place[rows] >= 0)
        vertices = corners[rows][shown]
        points[place[rows][shown]] = canonical_zero(np.asarray(positions[vertices]))
        let_go(place, faces, positions, points)
    written = new_array(folder / FACES, (kept, 3), index_type(count))
    done = 0
    for rows in blocks_of(len(faces)):
        stay = label[faces[rows][~dropped[rows]]]
        written[done : done + len(stay)] = place[stay]
        done += len(stay)
        let_go(faces, label, place, written)
    sync(folder / POSITIONS)
    sync(folder / FACES)
    scratch.remove()
    return Dropped(int(dropped.sum()) - repeated, repeated, len(positions) - count)


class _Scratch:
    """Arrays and files of rows that are thrown away afterwards."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files: list[Path] = []

    def array(self, name: str, count: int, fill: int) -> np.ndarray:
        path = self._folder / f"scratch-{name}.npy"
        self._files.append(path)
        array = new_array(path, (max(1, count),), "<i8")
        for rows in blocks_of(count):
            array[rows] = fill
            let_go(array)
        return array[:count]

    def dealt(self, name: str, rows: Iterator[Int[np.ndarray, "N K"]], total: int, width: int):
        """Yield the rows in groups: those with the same first ``width`` columns are together."""
        number = -(-total // SORTED) or 1
        files = [self._folder / f"scratch-{name}-{k}" for k in range(number)]
        self._files += files
        for file in files:
            file.write_bytes(b"")
        columns = 0
        for block in rows:
            columns = block.shape[1]
            group = (_mixed(block[:, :width]) % np.uint64(number)).astype(np.int64)
            order = np.argsort(group, kind="stable")
            counts = np.bincount(group, minlength=number)
            ends = np.cumsum(counts)
            for k in np.flatnonzero(counts):
                append(files[k], block[order[ends[k] - counts[k] : ends[k]]])
        for file in files:
            if columns:
                yield np.fromfile(file, dtype=np.int64).reshape(-1, columns)

    def remove(self) -> None:
        for file in self._files:
            file.unlink(missing_ok=True)


def _mixed(columns: Int[np.ndarray, "N K"]) -> Int[np.ndarray, " N"]:
    """Return a 64-bit mix of each row."""
    mixed = np.full(len(columns), 0x9E3779B97F4A7C15, dtype=np.uint64)
    for column in columns.T:
        mixed = (mixed ^ column.astype(np.uint64)) * MIX
        mixed ^= mixed >> np.uint64(32)
    return mixed


def _first_alike(keys: Int[np.ndarray, "N K"]) -> Int[np.ndarray, " N"]:
    """Return for each row an equal one that is not later: itself, where there is none before it.

    The first of them all, unless rows of one hash differ and lie between.
    """
    order = np.argsort(_mixed(keys), kind="stable")
    ordered = keys[order]
    opens = np.ones(len(order), dtype=bool)
    opens[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    result = np.empty(len(order), dtype=np.int64)
    result[order] = order[np.flatnonzero(opens)[np.cumsum(opens) - 1]]
    return result


def _first_corners(positions: np.ndarray, faces: np.ndarray, scratch: _Scratch) -> np.ndarray:
    """Return the first corner 3 f + i of each of the file's vertices; −1 where no face uses it."""
    first = scratch.array("first", len(positions), -1)
    for rows in blocks_of(len(faces)):
        corners = faces[rows].reshape(-1)
        outside = (corners < 0) | (corners >= len(positions))
        if outside.any():
            face = rows.start + int(np.argmax(outside)) // 3
            indices = faces[face].tolist()
            raise UnrefinableError(
                f"face {face}: indices {indices}, expected 0 … {len(positions) - 1}"
            )
        vertices, corner = np.unique(corners, return_index=True)
        new = first[vertices] < 0
        first[vertices[new]] = 3 * rows.start + corner[new]
        let_go(faces, first)
    return first


def _labels(positions: np.ndarray, first: np.ndarray, scratch: _Scratch) -> np.ndarray:
    """Return for each of the file's vertices the first corner of all that lie where it does."""
    # First the vertex of its block that stands for it, then what is known of that one.
    label = scratch.array("label", len(positions), -1)
    known = scratch.array("known", len(positions), -1)

    def rows() -> Iterator[Int[np.ndarray, "N 5"]]:
        for block in blocks_of(len(positions)):
            used = block.start + np.flatnonzero(first[block] >= 0)
            points = canonical_zero(np.asarray(positions[used], dtype=np.float64))
            keys = points.view(np.int64)
            alike = _first_alike(keys)
            label[used] = used[alike]
            earliest = first[used]
            np.minimum.at(earliest, alike, first[used])
            stands = alike == np.arange(len(alike))
            yield np.column_stack([keys, earliest, used])[stands]
            let_go(positions, first, label)

    for group in scratch.dealt("positions", rows(), len(positions), 3):
        ordered, opens = _sorted(group, 3)
        leader = np.minimum.reduceat(ordered[:, 3], opens) if len(opens) else ordered[:, 3]
        sizes = np.diff(opens, append=len(ordered))
        known[ordered[:, 4]] = np.repeat(leader, sizes)
        let_go(known)
    for block in blocks_of(len(positions)):
        used = block.start + np.flatnonzero(label[block] >= 0)
        label[used] = known[label[used]]
        let_go(label, known)
    return label


def _repeated_faces(
    faces: np.ndarray, label: np.ndarray, scratch: _Scratch
) -> tuple[Bool[np.ndarray, " F"], int]:
    """Return the faces to drop, and how many of them are like an earlier one."""
    dropped = np.zeros(len(faces), dtype=bool)
    repeated = 0

    def rows() -> Iterator[Int[np.ndarray, "N 4"]]:
        nonlocal repeated
        for block in blocks_of(len(faces)):
            corners = label[faces[block]]
            flat = repeated_vertex(corners)
            dropped[block] = flat
            stay = block.start + np.flatnonzero(~flat)
            keys = np.sort(corners[~flat], axis=1)
            again = _first_alike(keys) != np.arange(len(keys))
            dropped[stay[again]] = True
            repeated += int(again.sum())
            yield np.column_stack([keys, stay])[~again]
            let_go(faces, label)

    for group in scratch.dealt("faces", rows(), len(faces), 3):
        # The sort is stable, so the first of a run is the earliest.
        ordered, opens = _sorted(group, 3)
        again = np.ones(len(ordered), dtype=bool)
        again[opens] = False
        dropped[ordered[again, 3]] = True
        repeated += int(again.sum())
    return dropped, repeated


def _places(
    faces: np.ndarray, label: np.ndarray, dropped: np.ndarray, scratch: _Scratch
) -> tuple[np.ndarray, int]:
    """Give vertices that stay numbers, at each one's first corner, else −1; return how many."""
    place = scratch.array("place", 3 * len(faces), -1)
    for rows in blocks_of(len(faces)):
        place[label[faces[rows][~dropped[rows]]].reshape(-1)] = 0
        let_go(faces, label, place)
    count = 0
    for rows in blocks_of(len(place)):
        shown = np.flatnonzero(place[rows] == 0)
        place[rows.start + shown] = count + np.arange(len(shown))
        count += len(shown)
        let_go(place)
    return place, count


def _sorted(
    rows: Int[np.ndarray, "N K"], width: int
) -> tuple[Int[np.ndarray, "N K"], Int[np.ndarray, " G"]]:
    """Sort rows by their first columns; return also where runs of equal ones begin."""
    order = np.lexsort([rows[:, column] for column in range(width)])
    ordered = rows[order]
    if not len(ordered):
        return ordered, np.zeros(0, dtype=np.int64)
    differs = (ordered[1:, :width] != ordered[:-1, :width]).any(axis=1)
    return ordered, np.flatnonzero(np.r_[True, differs])
