"""Request bodies and answers, kept in files without a name that a worker process opens by path.

Bodies go to the worker this way, not through a pipe: the server process copies them in small
pieces, parses nothing and pickles nothing, so no upload can hold its event loop; and a worker
killed in the middle leaves no half-read pipe behind. On Linux the file is memory (no disk, no tmpfs
quota); elsewhere a temporary file.

A path into `/proc` is a number that the kernel gives to the next file once this one is closed. So a
file stays open until the worker that was given its path has ended its job, or has been killed.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ..errors import NoStorageError

PIECE = 256 * 1024


class MemoryFile:
    """A file that others open by its `name`; gone at the end of the `with` block.

    Raises:
        NoStorageError: nothing can be written there.
    """

    def __init__(self) -> None:
        try:
            if hasattr(os, "memfd_create"):
                self._file = os.fdopen(os.memfd_create("pns", os.MFD_CLOEXEC), "w+b", buffering=0)
                self.name = f"/proc/{os.getpid()}/fd/{self._file.fileno()}"
            else:
                self._file = tempfile.NamedTemporaryFile(prefix="pns-", buffering=0)  # noqa: SIM115
                self.name = self._file.name
        except OSError as error:
            raise NoStorageError(f"no file can be made: {error.strerror}") from error

    def __enter__(self) -> MemoryFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def append(self, data: bytes) -> None:
        """Write `data` at the end. Raises NoStorageError."""
        _write(self._file.fileno(), data)

    @property
    def size(self) -> int:
        """Bytes in the file, whichever process wrote them."""
        return os.fstat(self._file.fileno()).st_size

    def pieces(self) -> Iterator[bytes]:
        """Yield the content in pieces of at most `PIECE` bytes."""
        offset = 0
        while piece := os.pread(self._file.fileno(), PIECE, offset):
            yield piece
            offset += len(piece)


def write(name: str, data: bytes) -> None:
    """Fill the file of another process. Raises NoStorageError, and has then left nothing there."""
    with Path(name).open("wb", buffering=0) as file:
        try:
            _write(file.fileno(), data)
        except NoStorageError:
            # What is half an answer would only keep the room from others.
            file.truncate(0)
            raise


def _write(descriptor: int, data: bytes) -> None:
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(descriptor, view) :]
    except OSError as error:
        raise NoStorageError(f"{len(data)} bytes do not fit: {error.strerror}") from error
