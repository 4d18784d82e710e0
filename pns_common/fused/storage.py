"""Where compiled kernels are kept: beside their source, else in a folder of the user's.

Only its owner may touch that one: what is read from there is run. An image with a read-only root
brings kernels compiled when it was built, beside their source.
"""

from __future__ import annotations

import os
import stat
import tempfile
from functools import cache
from pathlib import Path

KERNELS = Path(__file__).resolve().parent / "kernels"
BUILT = KERNELS / "__pycache__"
STEM = "kernels-"


@cache
def cache_folder() -> Path | None:
    """Return the folder that new kernels are written to; None where there is none."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    if _is_writable(BUILT if BUILT.exists() else KERNELS):
        return BUILT
    return private_folder(Path(tempfile.gettempdir()))


def kernel_file(key: str) -> Path | None:
    """Return the file of a key: with the package, if it came so; else in ``cache_folder``."""
    name, folder = f"{STEM}{key}.o", cache_folder()
    if (BUILT / name).exists():
        return BUILT / name
    return folder / name if folder is not None else None


def kernels_are_kept() -> bool:
    """Return whether kernels were compiled here before.

    Perhaps that was for another processor or version.
    """
    folder = cache_folder()
    return any(any(each.glob(f"{STEM}*.o")) for each in (BUILT, folder) if each is not None)


def private_folder(parent: Path) -> Path | None:
    """Return a folder of this user's alone, made if need be; None where there cannot be one."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = parent / f"pns-kernels-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    mine = stat.S_ISDIR(status.st_mode) and (not hasattr(os, "getuid") or status.st_uid == user)
    # Whoever else may write there could have us run anything.
    return folder if mine and not status.st_mode & 0o022 and _is_writable(folder) else None


def _is_writable(folder: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
