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
    with _new_file(path) as (temporary, descriptor):
        os.close(descriptor)
        yield temporary


def replace_file(path: Path, data: bytes) -> None:
    """Write `data` in the place of `path`, whole or not at all: see `replacing`."""
    with _new_file(path) as (_, descriptor), os.fdopen(descriptor, "wb") as file:
        file.write(data)


@contextmanager
def _new_file(path: Path) -> Generator[tuple[Path, int], None, None]:
    """Yield the name of a new file and its descriptor, which is to be closed."""
    # So much of the name as shows whose it is: a file may have one as long as the system allows.
    temporary = path.with_name(f".{path.name[:40]}.{secrets.token_hex(8)}.tmp")
    try:
        # The mode of any file that a user writes: the system takes the umask off.
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    except OSError as error:
        # Nobody asked for the temporary name.
        error.filename = str(path)
        raise
    try:
        yield temporary, descriptor
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
