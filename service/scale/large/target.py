"""Where the refined mesh goes: arrays in files of their final size, which parts fill in any order.

Each part writes the rows that are its own and no others, so that writing them again after a fault,
or while another part is written, changes nothing.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ...errors import check_limit
from .arrays import FACES, POSITIONS, blocks_of, index_type, new_array, reserve

# Rows that are written before their pages are given back.
ROWS = 1 << 19
COUNT, CORNERS = "count", "corners"
LARGEST_UINT32 = 2**32 - 1


@dataclass(frozen=True)
class Target:
    """Files to write positions and faces into.

    Attributes:
        positions, faces: the files, and where in them the rows begin.
        listed: whether a face is a count of corners, 3, and then its corners, as PLY has it.
    """

    positions: tuple[str, int]
    faces: tuple[str, int]
    vertex_count: int
    face_count: int
    listed: bool

    @property
    def face_type(self) -> np.dtype:
        """A face's record."""
        if self.listed:
            return np.dtype([(COUNT, "u1"), (CORNERS, "<u4", (3,))])
        return np.dtype([(CORNERS, index_type(self.vertex_count), (3,))])

    def write_vertices(self, ids: Int[np.ndarray, " N"], points: Float[np.ndarray, "N 3"]) -> None:
        """Write vertices at the places that their numbers give them."""
        kind = np.dtype(("<f8", (3,)))
        with _rows(self.positions, self.vertex_count, kind) as (rows, forget):
            for chunk in blocks_of(len(ids), ROWS):
                rows[ids[chunk]] = points[chunk]
                forget()

    def write_children(
        self, parents: Int[np.ndarray, " N"], children: Int[np.ndarray, "N M 3"]
    ) -> None:
        """Write all M descendants of some control faces."""
        many = children.shape[1]
        with _rows(self.faces, self.face_count, self.face_type) as (rows, forget):
            families = rows.reshape(-1, many)
            for chunk in blocks_of(len(parents), max(1, ROWS // many)):
                written = np.empty((chunk.stop - chunk.start, many), dtype=self.face_type)
                if self.listed:
                    written[COUNT] = 3
                written[CORNERS] = children[chunk]
                families[parents[chunk]] = written
                forget()


@contextmanager
def _rows(
    place: tuple[str, int], count: int, kind: np.dtype
) -> Iterator[tuple[np.ndarray, Callable[[], None]]]:
    path, offset = place
    with Path(path).open("r+b") as file:
        memory = mmap.mmap(file.fileno(), 0)
        rows = np.frombuffer(memory, dtype=kind, count=count, offset=offset)
        yield rows, lambda: memory.madvise(mmap.MADV_DONTNEED)
        memory.flush()


def new_folder(folder: Path, vertex_count: int, face_count: int) -> Target:
    """Create the arrays of a folder, empty.

    Raises:
        LimitError: the disk has no room for them.
    """
    places: list[tuple[str, int]] = []
    for name, count, dtype in (
        (POSITIONS, vertex_count, "<f8"),
        (FACES, face_count, index_type(vertex_count)),
    ):
        array = new_array(folder / name, (count, 3), dtype)
        places.append((str(folder / name), array.offset))
    return Target(places[0], places[1], vertex_count, face_count, listed=False)


def new_ply(path: Path, vertex_count: int, face_count: int) -> Target:
    """Create a binary PLY, empty but for its header: double positions, and triangles.

    Raises:
        LimitError: the disk has no room for it, or there are more vertices than it can number.
    """
    text = f"the PLY would have {vertex_count} vertices (a folder of arrays may have any number)"
    check_limit("ply vertices", vertex_count, LARGEST_UINT32, text)
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {vertex_count}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {face_count}",
        "property list uchar uint vertex_indices",
        "end_header",
    ]
    header = ("\n".join(lines) + "\n").encode()
    path.write_bytes(header)
    faces = len(header) + 24 * vertex_count
    target = Target((str(path), len(header)), (str(path), faces), vertex_count, face_count, True)
    reserve(path, faces + target.face_type.itemsize * face_count)
    return target
