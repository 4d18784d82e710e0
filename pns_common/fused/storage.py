"""Where compiled kernels are kept: beside their source, else in a folder of the user's.

numba refuses to compile for a cache that it cannot write. An image with a read-only root brings
kernels compiled when it was built; they are copied to the temporary folder, which only their owner
may touch: what is read from a cache is run.
"""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from functools import cache
from pathlib import Path

from pns_common.whole_file import replacing

KERNELS = Path(__file__).resolve().parent / "kernels"
BUILT = KERNELS / "__pycache__"


@cache
def cache_folder() -> Path | None:
    """The folder that kernels are kept in; None where there is none to write to."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    if _is_writable(BUILT if BUILT.exists() else KERNELS):
        return BUILT
    return private_folder(Path(tempfile.gettempdir()))


def private_folder(parent: Path) -> Path | None:
    """A folder of this user's alone, made if need be; None where there cannot be one."""
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


def copy_built(built: Path, to: Path) -> None:
    """Copy compiled kernels that are not there yet, each under another name first."""
    to.mkdir(mode=0o700, parents=True, exist_ok=True)
    for source in [*built.glob("*.nbi"), *built.glob("*.nbc")]:
        if not (to / source.name).exists():
            with replacing(to / source.name) as temporary:
                shutil.copyfile(source, temporary)


def _is_writable(folder: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
