"""The command `pns`, also `python -m pns_service`."""

from __future__ import annotations

import os
import signal
from types import FrameType

OURS = ("pns_common", __package__)


def main() -> None:
    """Run the command line, or say what to install."""
    # The first process of a container hears no signal that it has no handler for, while it imports.
    signal.signal(signal.SIGTERM, _end)
    try:
        from .cli import main as command_line

        command_line()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in OURS:
            raise
        raise SystemExit(
            f"pns: the package {error.name} is missing: pip install 'pns-subdivision[service]'"
        ) from error


def _end(number: int, _: FrameType | None) -> None:
    # As the system would. Packages that import optional parts may catch what is raised in them, and
    # go on without the part that was just being imported.
    os._exit(128 + number)


if __name__ == "__main__":
    main()
