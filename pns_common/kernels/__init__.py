"""Compiled loops over edges, faces and vertices.

Each module holds the loops of one subject. A loop is decorated with ``kernel``, and its parameters
say their types: ``f8_2d`` is a C-contiguous array of float64 of two axes, ``int``, ``float`` and
``bool`` are numbers, ``Connectivity`` is a mesh; ``f4_2d | f8_2d`` stands for a loop each. The
small functions of scalars and 3-vectors that its body is made of are decorated with ``inlined`` and
need no types.

All loops are compiled when the package is built (ahead.py), into ``compiled``. Where that is
missing, or older than a source here, or KERNELS_JIT=1 is set, numba compiles each loop at its first
call. Both give the same bits. No fast-math: nothing is reordered or contracted.

Loops over edges, faces or vertices take ``begin`` and ``end`` and write their own rows only, so
that several threads may share the work and the result does not depend on how they do.

Index arrays are uint32 where no index can be negative: compiled code then need not ask whether an
index counts from the end.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).parent
# 1: let numba compile each loop at its first call; ahead.py says "ahead".
JIT = os.environ.get("KERNELS_JIT", "")


@dataclass(frozen=True)
class ArrayType:
    """A C-contiguous array: numpy's code of its dtype, and how many axes it has."""

    dtype: str
    axes: int

    def __or__(self, other: ArrayType) -> tuple[ArrayType, ArrayType]:
        return self, other


f4_2d = ArrayType("f4", 2)
f8_1d, f8_2d = ArrayType("f8", 1), ArrayType("f8", 2)
i1_1d = ArrayType("i1", 1)
i4_1d, i4_2d = ArrayType("i4", 1), ArrayType("i4", 2)
i8_1d, i8_2d = ArrayType("i8", 1), ArrayType("i8", 2)
u4_1d, u4_2d = ArrayType("u4", 1), ArrayType("u4", 2)
b1_1d, b1_2d = ArrayType("b1", 1), ArrayType("b1", 2)


class Connectivity(NamedTuple):
    """Faces with their edges, as ``mesh.topology.Topology`` has them."""

    vertex_count: int
    corners: u4_1d
    offsets: i4_1d
    face_of_corner: u4_1d
    corner_edges: u4_1d
    edges: u4_2d
    half_edges: i4_2d
    edge_class: i1_1d


def sources_digest() -> str:
    """Return the SHA-256 of the sources of the loops, those in Python."""
    digest = hashlib.sha256()
    for path in sorted(HERE.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _compiled() -> dict[str, Any]:
    """Return the loops compiled ahead of time; none where they are missing, stale or not wanted."""
    try:
        from pns_common.kernels import compiled
    except ImportError:
        return {}
    return {} if JIT or sources_digest() != compiled.DIGEST else vars(compiled)


def _decorators() -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return what ``kernel`` and ``inlined`` are.

    Raises:
        ImportError: the loops are not compiled, and numba is not installed.
    """
    if AHEAD:
        return _loop_ahead, lambda function: function
    try:
        from numba import njit  # pyright: ignore[reportMissingTypeStubs]
    except ImportError:
        raise ImportError(
            "pns_common has no compiled loops for these sources. Install it again where there is a "
            "C compiler, or let numba compile them: pip install 'pns-subdivision[jit]'"
        ) from None
    # numba compares a cached loop with its own file, not with the files of what it calls.
    newest = max(path.stat().st_mtime for path in HERE.glob("*.py"))
    for path in (HERE / "__pycache__").glob("*.nb[ic]"):
        with suppress(FileNotFoundError):  # other processes that start meanwhile delete it too
            if path.stat().st_mtime < newest:
                path.unlink()
    building: dict[str, Any] = {"no_cpython_wrapper": JIT == "ahead", "no_cfunc_wrapper": True}
    return (
        njit(cache=JIT != "ahead", nogil=True, error_model="numpy", **building),
        njit(nogil=True, error_model="numpy", forceinline=True, **building),
    )


def _loop_ahead(function: Any) -> Any:
    return AHEAD[f"{function.__module__.rpartition('.')[2]}.{function.__name__}"]


AHEAD = _compiled()
kernel: Any
inlined: Any
kernel, inlined = _decorators()
