"""Request bodies and answers, kept in files without a name that a worker process opens by path.

Bodies go to the worker this way, not through a pipe: the server process copies them in small
pieces, parses nothing and pickles nothing, so no upload can hold its event loop; and a worker
killed in the middle leaves no half-read pipe behind. On Linux the file is memory (no disk, no tmpfs
quota); elsewhere a temporary file.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

PIECE = 256 * 1024


class MemoryFile:
    """A file that others open by its `path`, if they are told; gone once closed."""

    def __init__(self) -> None:
        if hasattr(os, "memfd_create"):
            self._file = os.fdopen(os.memfd_create("pns", os.MFD_CLOEXEC), "w+b", buffering=0)
            self.path = f"/proc/{os.getpid()}/fd/{self._file.fileno()}"
        else:
            self._file = tempfile.NamedTemporaryFile(prefix="pns-", buffering=0)  # noqa: SIM115
            self.path = self._file.name

    def __enter__(self) -> MemoryFile:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def append(self, data: bytes) -> None:
        """Write `data` at the end."""
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]

    @property
    def size(self) -> int:
        """Bytes in the file, whichever process wrote them."""
        return os.fstat(self._file.fileno()).st_size

    def pieces(self) -> Iterator[bytes]:
        """The content in pieces of at most `PIECE` bytes."""
        offset = 0
        while piece := os.pread(self._file.fileno(), PIECE, offset):
            yield piece
            offset += len(piece)

    def close(self) -> None:
        """Give the memory back."""
        self._file.close()


def write(path: str, data: bytes) -> None:
    """Fill the file of another process, found by its path."""
    Path(path).write_bytes(data)
