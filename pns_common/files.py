"""Writing a file whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Generator[Path, None, None]:
    """Yield the name of a new file beside `path`, and give it that place once it is written.

    Nobody ever sees half a file; where writing fails, nothing is left of the new one.

    Raises:
        OSError: the folder is missing or cannot be written, or the disk is full; it names `path`,
            which is then as it was.
    """
    with _put_in_place(path) as temporary:
        temporary.touch(exist_ok=False)
        yield temporary


def replace_file(path: Path, data: bytes) -> None:
    """Write `data` in the place of `path`, whole or not at all: see `replacing`.

    A process that is killed meanwhile leaves nothing, where the system can have it so.
    """
    with _put_in_place(path) as temporary:
        if not _written_without_name(temporary, data):
            with temporary.open("xb") as file:
                file.write(data)


def _written_without_name(path: Path, data: bytes) -> bool:
    """Write a new file that gets its name at the end: what has none the system takes back.

    Return whether that was done: a system that cannot, and a full disk, are told by the other way.
    """
    try:
        descriptor = os.open(path.parent, os.O_WRONLY | os.O_TMPFILE, 0o666)
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            # A link is followed to what it names only beside the descriptor of a folder.
            os.link(f"/proc/self/fd/{descriptor}", path, src_dir_fd=descriptor)
    except (AttributeError, OSError):
        return False
    return True


@contextmanager
def _put_in_place(path: Path) -> Generator[Path, None, None]:
    """Yield the name of a file to be written, and give it the place of `path` then."""
    # So much of the name as shows whose it is: a file may have one as long as the system allows.
    temporary = path.with_name(f".{path.name[:40]}.{secrets.token_hex(8)}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            _name(error, temporary, path)
        raise


def _name(error: OSError, temporary: Path, path: Path) -> None:
    """Say that it is of `path`: a write that fails names no file, or one that nobody asked for.

    Not where it is of other files, or has words of its own, in whose place a name would stand.
    """
    if error.errno is not None and error.filename in (None, temporary, str(temporary)):
        error.filename = str(path)
        # None would be told as a second name.
        del error.filename2
