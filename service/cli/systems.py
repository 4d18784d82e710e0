"""Commands that need what only POSIX systems have."""

from __future__ import annotations

from importlib.util import find_spec


def check_posix(command: str) -> None:
    """Raise StartError where there are no locks, signals and process sessions of POSIX.

    By these workers are ended, and a folder of work is kept from a second run.
    """
    from ..settings import StartError

    if find_spec("fcntl") is None:
        raise StartError(
            f"pns {command} needs a POSIX system: Linux, macOS, or, on Windows, WSL or the "
            "container; pns subdivide needs none"
        )
