"""Compiled loops over edges, faces and vertices.

Each module holds the loops of one subject. A loop is decorated with ``kernel``; the small functions
of scalars and 3-vectors that its body is made of are decorated with ``inlined``. Compilation
happens at the first call and is cached beside the sources, or in numba's cache folder where these
cannot be written. No fast-math: nothing is reordered or contracted.

Loops over edges, faces or vertices take ``begin`` and ``end`` and write their own rows only, so
that several threads may share the work and the result does not depend on how they do.

Index arrays are uint32 where no index can be negative: compiled code then need not ask whether an
index counts from the end.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import config, njit  # pyright: ignore[reportMissingTypeStubs]

kernel: Any = njit(cache=True, nogil=True, error_model="numpy")
inlined: Any = njit(nogil=True, error_model="numpy", forceinline=True)

ANNOUNCEMENT = "Compiling kernels, once: about half a minute"


def are_compiled() -> bool:
    """Return whether compiled code is kept from an earlier run."""
    folder = Path(config.CACHE_DIR) if config.CACHE_DIR else Path(__file__).parent / "__pycache__"
    return any(folder.rglob("children.*.nbc"))


def forget_stale_code() -> None:
    """Delete cached code that is older than any source file of this package.

    numba compares a cached loop with the file that the loop stands in, and not with the files of
    the functions that the loop calls.
    """
    here = Path(__file__).parent
    newest = max(path.stat().st_mtime for path in here.glob("*.py"))
    for path in (here / "__pycache__").glob("*.nb[ic]"):
        # Other processes that start meanwhile delete it too.
        with suppress(FileNotFoundError):
            if path.stat().st_mtime < newest:
                path.unlink()


forget_stale_code()
