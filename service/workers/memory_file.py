"""Request bodies and answers, kept in files without a name that a worker process opens by path.

Bodies go to the worker this way, not through a pipe: the server process copies them in small
pieces, parses nothing and pickles nothing, so no upload can hold its event loop; and a worker
killed in the middle leaves no half-read pipe behind. On Linux the file is memory (no disk, no tmpfs
quota); elsewhere a temporary file.

A path into `/proc` is a number that the kernel gives to the next file once this one is closed, and
a worker may open it late. So who opens it compares what was opened with what was meant.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import NoStorageError

PIECE = 256 * 1024


class ForeignFileError(RuntimeError):
    """A path led to another file than the one that was meant: a fault of ours."""


@dataclass(frozen=True, slots=True)
class FileName:
    """Name by which another process opens a memory file: its path, its device and inode."""

    path: str
    device: int
    inode: int


class MemoryFile:
    """A file that others open by its `name`; gone at the end of the `with` block.

    Raises:
        NoStorageError: nothing can be written there.
    """

    def __init__(self) -> None:
        try:
            self._open()
        except OSError as error:
            raise NoStorageError(f"no file can be made: {error.strerror}") from error

    def _open(self) -> None:
        if hasattr(os, "memfd_create"):
            self._file = os.fdopen(os.memfd_create("pns", os.MFD_CLOEXEC), "w+b", buffering=0)
            path = f"/proc/{os.getpid()}/fd/{self._file.fileno()}"
        else:
            self._file = tempfile.NamedTemporaryFile(prefix="pns-", buffering=0)  # noqa: SIM115
            path = self._file.name
        status = os.fstat(self._file.fileno())
        self.name = FileName(path, status.st_dev, status.st_ino)

    def __enter__(self) -> MemoryFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the memory back, once the worker that has it open has closed it too."""
        self._file.close()

    @property
    def descriptor(self) -> int:
        """The descriptor of this process."""
        return self._file.fileno()

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


def read(name: FileName) -> bytes:
    """Read all bytes of another process's file. Raises ForeignFileError."""
    with os.fdopen(opened(name, os.O_RDONLY), "rb") as file:
        return file.read()


def write(name: FileName, data: bytes) -> None:
    """Fill the file of another process.

    Raises ForeignFileError, and has then written nothing; NoStorageError, and has left nothing.
    """
    # Not truncated while it is opened: it might be another file.
    descriptor = opened(name, os.O_WRONLY)
    try:
        os.ftruncate(descriptor, 0)
        try:
            _write(descriptor, data)
        except NoStorageError:
            # What is half an answer would only keep the room from others.
            os.ftruncate(descriptor, 0)
            raise
    finally:
        os.close(descriptor)


def _write(descriptor: int, data: bytes) -> None:
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(descriptor, view) :]
    except OSError as error:
        raise NoStorageError(f"{len(data)} bytes do not fit: {error.strerror}") from error


def opened(name: FileName, flags: int) -> int:
    """Open another process's file; return its descriptor. Raises ForeignFileError."""
    # Another file might be a pipe, whose opening waits for its other end.
    descriptor = os.open(name.path, flags | os.O_CLOEXEC | os.O_NONBLOCK)
    status = os.fstat(descriptor)
    if (status.st_dev, status.st_ino) != (name.device, name.inode):
        os.close(descriptor)
        raise ForeignFileError(f"{name.path} is another file than the one that was meant")
    return descriptor
