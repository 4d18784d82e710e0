"""A mesh as a folder of raw arrays, which any number of processes read and write by memory map.

    positions.npy   (V, 3) float64 or float32
    faces.npy       (F, 3) int32 or int64, rows of positions
    creases.npy     (N, 2) int32 or int64, edges to keep sharp; may be missing
    mesh.json       what made it; for readers alone

All are NumPy's own format, version 1, little-endian, in C order.
"""

from __future__ import annotations

import errno
import mmap
import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError

import numpy as np
from jaxtyping import Float, Int

from ...errors import LimitError, UnreadableError

POSITIONS, FACES, CREASES, ABOUT = "positions.npy", "faces.npy", "creases.npy", "mesh.json"
# Rows that are read or written at a time.
BLOCK = 1 << 20
LARGEST_INT32 = 2**31 - 1


@dataclass(frozen=True, eq=False)
class ArrayMesh:
    """The arrays of a folder, read where they are needed."""

    folder: Path
    positions: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    creases: Int[np.ndarray, "N 2"] | None


def open_mesh(folder: Path) -> ArrayMesh:
    """Open a folder; what its arrays hold is not looked at.

    Raises:
        UnreadableError: an array is missing, or has another shape or type.
    """
    creases = folder / CREASES
    return ArrayMesh(
        folder,
        _open(folder / POSITIONS, 3, ("<f8", "<f4")),
        _open(folder / FACES, 3, ("<i4", "<i8")),
        _open(creases, 2, ("<i4", "<i8")) if creases.exists() else None,
    )


def index_type(vertices: int) -> str:
    """Return the type of indices that so many vertices need."""
    return "<i4" if vertices <= LARGEST_INT32 else "<i8"


def new_array(path: Path, shape: tuple[int, ...], dtype: str) -> np.memmap:
    """Create a .npy to write into; its room on the disk is taken at once.

    Raises:
        LimitError: the disk has no room for it.
    """
    array = np.lib.format.open_memmap(path, mode="w+", dtype=dtype, shape=shape)
    reserve(path, path.stat().st_size)
    return array


@contextmanager
def finished_array(
    path: Path, shape: tuple[int, ...], dtype: str
) -> Generator[np.memmap, None, None]:
    """Create a .npy to write into, which gets its name once it is written: see ``new_array``.

    What is left of one that was not is written over by the next.
    """
    temporary = path.with_name(f"{path.name}.tmp")
    yield new_array(temporary, shape, dtype)
    sync(temporary)
    temporary.rename(path)


def sync(path: Path) -> None:
    """Have a file on the disk before it is told to be there: a power cut may leave it as zeros."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def reserve(path: Path, size: int) -> None:
    """Take room on the disk, so that no later write finds it full.

    Where there is none, none is taken, and nothing of the file is kept.

    Raises:
        LimitError: there is none.
    """
    there = path.stat()
    status = os.statvfs(path.parent)
    free = status.f_bavail * status.f_frsize
    # A sparse file takes room for what it does not hold yet; blocks are of 512 bytes.
    if size - 512 * there.st_blocks > free:
        raise _no_room(path, size, free)
    with path.open("r+b") as file:
        if not hasattr(os, "posix_fallocate"):  # macOS
            file.truncate(size)
            return
        try:
            os.posix_fallocate(file.fileno(), 0, max(1, size))
        except OSError as error:
            # Some file systems take all that there is before they find that it is too little.
            file.truncate(0)
            if error.errno not in (errno.ENOSPC, errno.EFBIG):
                raise
            raise _no_room(path, size, free) from error


def _no_room(path: Path, size: int, free: int) -> LimitError:
    return LimitError(
        f"{path}: {size / 1e9:.1f} GB are needed, {free / 1e9:.1f} GB are free",
        limit="disk",
        allowed=free,
        found=size,
    )


def append(path: Path, rows: np.ndarray) -> None:
    """Write rows at the end of a file, which may be new.

    Raises:
        OSError: it names the file and says why; numpy's own does neither where the disk is full.
    """
    data = np.ascontiguousarray(rows).reshape(-1).view(np.uint8).data
    # Without a buffer: what that holds is written at the end, by a close that names no file.
    with path.open("ab", buffering=0) as file:
        try:
            while len(data):
                data = data[file.write(data) :]
        except OSError as error:
            error.filename = str(path)
            raise


def blocks_of(count: int, rows: int = BLOCK) -> Iterator[slice]:
    """Yield slices of so many rows that cover range(count)."""
    for start in range(0, count, rows):
        yield slice(start, min(start + rows, count))


def let_go(*arrays: np.ndarray) -> None:
    """Give back the pages of arrays that are mapped, which a pass over them would otherwise hold.

    What was written stays written; what is read again is mapped again.
    """
    for array in arrays:
        memory = getattr(array, "_mmap", None)
        if memory is not None:
            memory.madvise(mmap.MADV_DONTNEED)


def _open(path: Path, columns: int, types: tuple[str, ...]) -> np.ndarray:
    try:
        # A header's counts may be too large for any product of them.
        with np.errstate(over="ignore"):
            array = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, OverflowError, TokenError) as error:
        raise UnreadableError(f"{path}: this is not a readable .npy file") from error
    kinds = [np.dtype(kind) for kind in types]
    if array.ndim != 2 or array.shape[1] != columns or array.dtype not in kinds:
        names = " or ".join(kind.name for kind in kinds)
        raise UnreadableError(
            f"{path}: it holds {array.dtype} of shape {array.shape}; "
            f"expected {names} of shape (N, {columns})"
        )
    if not array.flags.c_contiguous:
        raise UnreadableError(f"{path}: its rows must lie one after the other (C order)")
    return array
