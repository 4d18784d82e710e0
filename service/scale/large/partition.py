"""Cut a mesh into parts of equally many faces that lie together: the Morton order of centroids.

The box around the mesh has 128³ cells, numbered in Morton order. Faces are ordered by the cell of
their centroid, then by their number, and cut into P runs: a counting sort in two passes that holds
a block of faces and a number for each cell. A cell with many faces is cut by their numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int

from .arrays import ArrayMesh, blocks_of, finished_array, let_go
from .survey import Survey

BITS = 7
CELLS = 1 << (3 * BITS)
ORDER = "order.npy"


@dataclass(frozen=True, eq=False)
class Parts:
    """Which faces are each part's own: ``order[starts[p]:starts[p + 1]]``, ascending."""

    order: Int[np.ndarray, " F"]
    starts: Int[np.ndarray, " N"]

    @classmethod
    def open(cls, folder: Path, parts: int) -> Parts:
        """Open what ``cut`` left in a folder."""
        order = np.load(folder / ORDER, mmap_mode="r")
        return cls(order, part_starts(len(order), parts))

    def own(self, part: int) -> Int[np.ndarray, " N"]:
        """Return the faces of a part."""
        return np.array(self.order[self.starts[part] : self.starts[part + 1]])


def part_starts(faces: int, parts: int) -> Int[np.ndarray, " N"]:
    """Return where each part begins, and the last ends."""
    return np.array([faces * part // parts for part in range(parts + 1)], dtype=np.int64)


def cut(mesh: ArrayMesh, survey: Survey, parts: int, folder: Path) -> None:
    """Order the faces by part, in ``folder``."""
    sizes = np.zeros(CELLS, dtype=np.int64)
    for rows in blocks_of(survey.faces):
        sizes += np.bincount(cells_of(mesh, survey, rows), minlength=CELLS)
        let_go(mesh.positions, mesh.faces)
    following = np.cumsum(sizes) - sizes
    starts = part_starts(survey.faces, parts)
    with finished_array(folder / ORDER, (survey.faces,), "<i8") as order:
        free = starts[:-1].copy()
        for rows in blocks_of(survey.faces):
            rank = _ranks(cells_of(mesh, survey, rows), following)
            part = np.searchsorted(starts, rank, side="right") - 1
            by_part = np.argsort(part, kind="stable")
            counts = np.bincount(part, minlength=parts)
            ends = np.cumsum(counts)
            for number in np.flatnonzero(counts):
                faces = by_part[ends[number] - counts[number] : ends[number]]
                order[free[number] : free[number] + len(faces)] = rows.start + faces
            free += counts
            let_go(mesh.positions, mesh.faces, order)


def cells_of(mesh: ArrayMesh, survey: Survey, rows: slice) -> Int[np.ndarray, " N"]:
    """Return the Morton number of the cell of each face's centroid."""
    low, high = np.array(survey.low), np.array(survey.high)
    corners = np.asarray(mesh.positions[mesh.faces[rows].reshape(-1)], dtype=np.float64)
    # Coordinates may be near the largest that there are: no sum before they are scaled.
    extent = np.where(high > low, high - low, 1.0)
    centroids = ((corners - low) / extent).reshape(-1, 3, 3).mean(axis=1)
    cells = np.clip((centroids * (1 << BITS)).astype(np.int64), 0, (1 << BITS) - 1)
    return spread(cells[:, 0]) | spread(cells[:, 1]) << 1 | spread(cells[:, 2]) << 2


def spread(values: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Put each bit i at place 3 i."""
    result = np.zeros_like(values)
    for bit in range(BITS):
        result |= (values >> bit & 1) << 3 * bit
    return result


def _ranks(cells: Int[np.ndarray, " N"], following: Int[np.ndarray, " M"]) -> Int[np.ndarray, " N"]:
    """Return a block's faces' places in the whole order; ``following`` goes on behind them."""
    by_cell = np.argsort(cells, kind="stable")
    ordered = cells[by_cell]
    opens = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    counts = np.diff(opens, append=len(ordered))
    place = np.arange(len(ordered)) - np.repeat(opens, counts)
    rank = np.empty(len(cells), dtype=np.int64)
    rank[by_cell] = following[ordered] + place
    following[ordered[opens]] += counts
    return rank
