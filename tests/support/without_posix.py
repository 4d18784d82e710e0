"""`python -m tests.support.without_posix …`: `pns` where POSIX is missing, as on Windows.

The project's own modules find neither what of `os` and `signal` Windows has not, nor the modules
that it has not; what others made works as ever.
"""

from __future__ import annotations

import builtins
import importlib.util
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

OURS = ("pns_common", "service")
NO_MODULES = {"fcntl", "grp", "posix", "pwd", "resource", "termios"}
# Of the library's documentation: "Availability: Unix", "not Windows".
NOT_OF_OS = """
    O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_TMPFILE WNOHANG MFD_CLOEXEC chown confstr fchmod
    fchown fork geteuid getegid getgid getloadavg getpgid getsid getuid killpg memfd_create mkfifo
    nice posix_fadvise posix_fallocate pread pwrite register_at_fork sched_getaffinity
    sched_setaffinity setpgid setsid statvfs sync sysconf uname wait4
"""
NOT_OF_SIGNAL = """
    SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 SIG_BLOCK SIG_SETMASK SIG_UNBLOCK
    alarm pause pthread_sigmask setitimer sigwait
"""

_import, _find = builtins.__import__, importlib.util.find_spec


def without(module: ModuleType, names: str) -> ModuleType:
    """Return a copy of a module that lacks some names."""
    copy, gone = ModuleType(module.__name__), names.split()
    vars(copy).update({key: value for key, value in vars(module).items() if key not in gone})
    return copy


POORER = {"os": without(os, NOT_OF_OS), "signal": without(signal, NOT_OF_SIGNAL)}


def restricted_import(
    name: str,
    importer: Mapping[str, object] | None = None,
    local: Mapping[str, object] | None = None,
    fromlist: Sequence[str] = (),
    level: int = 0,
) -> Any:
    """Import a module, poorer for those of the project."""
    if level == 0 and str((importer or {}).get("__name__")).partition(".")[0] in OURS:
        if name in NO_MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in POORER:
            return POORER[name]
    return _import(name, importer, local, fromlist, level)


def restricted_find(name: str, package: str | None = None) -> Any:
    """Find a module, but none of those that are missing."""
    return None if name in NO_MODULES else _find(name, package)


def main() -> None:
    """Run the command line."""
    builtins.__import__ = restricted_import
    importlib.util.find_spec = restricted_find
    from service.__main__ import main as pns

    pns()


if __name__ == "__main__":
    sys.argv[0] = "pns"
    main()
