"""Compile all kernels to one object file, which can be loaded without the compiler.

numba types and optimises a function; what it makes takes every array as a row of numbers. Beside
it stands an entry that takes numpy's arrays as they are and reads those numbers from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import isfunction
from types import ModuleType
from typing import Any

import llvmlite.binding as llvm  # pyright: ignore[reportMissingTypeStubs]
import numba  # pyright: ignore[reportMissingTypeStubs]
from numba.extending import register_jitable  # pyright: ignore[reportMissingTypeStubs]

from pns_common.fused.kernels.compiled import SELDOM, Array, Kernel
from pns_common.fused.library import kernels_of, processor, target_machine

# numba's own names are not typed.
_numba: Any = numba
_llvm: Any = llvm

LLVM_TYPES = {"int64": "i64", "float64": "double"}
# Where numpy keeps what its macros PyArray_DATA, PyArray_DIMS and PyArray_STRIDES read, after the
# head that every Python object has.
DATA, SHAPE, STRIDES = (object.__basicsize__ + offset for offset in (0, 16, 24))


def compile_kernels(modules: Sequence[ModuleType]) -> bytes:
    """Compile all kernels of some modules into one object file."""
    # numba optimises for the processor that the code is made for.
    _numba.config.CPU_NAME, _numba.config.CPU_FEATURES = processor()
    for helper in _helpers(modules):
        register_jitable(forceinline=not hasattr(helper, SELDOM))(helper)
    whole = _llvm.parse_assembly("")
    for kernel in kernels_of(modules):
        whole.link_in(_compiled(kernel))
    whole.verify()
    return target_machine().emit_object(whole)


def _helpers(modules: Sequence[ModuleType]) -> list[Any]:
    """Return the functions that kernels call."""
    return [
        value
        for module in modules
        for value in vars(module).values()
        if isfunction(value) and value.__module__ == module.__name__
    ]


def _compiled(kernel: Kernel) -> Any:
    """Compile a kernel, under its name, to a module of LLVM."""
    types = tuple(_type(each) for each in kernel.arguments)
    # Nothing is to be called from Python in numba's way, which needs numba.
    alone = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
    before, _numba.config.SLP_VECTORIZE = _numba.config.SLP_VECTORIZE, int(kernel.by_rows)
    try:
        compiled = _numba.njit(nogil=True, error_model="numpy", **alone)(kernel.function)
        compiled.compile(getattr(_numba, kernel.result)(*types))
    finally:
        # It is the process's own.
        _numba.config.SLP_VECTORIZE = before
    text = compiled.inspect_llvm(types)
    made = [f.name for f in _llvm.parse_assembly(text).functions if not f.is_declaration]
    main = compiled.overloads[types].fndesc.llvm_func_name
    assert main in made
    return _llvm.parse_assembly(text + _entry(kernel, main))


def _type(of: Array | str) -> Any:
    if isinstance(of, Array):
        # numba takes writable arrays where it expects read-only ones.
        name = "uint32" if of.natural else "boolean" if of.dtype == "bool" else of.dtype
        dtype = getattr(_numba.types, name)
        return _numba.types.Array(dtype, of.ndim, "C", readonly=not of.written)
    return getattr(_numba, of)


def _entry(kernel: Kernel, main: str) -> str:
    """Return the function that takes arrays as they are, as LLVM's text.

    In numba's convention an array is: two pointers to owners, which borrowed arrays have not, its
    number of elements and their size, which nothing reads, its data, its shape and its strides.
    """
    lines, given, passed = list[str](), list[str](), ["ptr %result", "ptr %error"]
    for i, of in enumerate(kernel.arguments):
        if not isinstance(of, Array):
            given.append(f"{LLVM_TYPES[of]} %a{i}")
            passed.append(given[-1])
            continue
        given.append(f"ptr %a{i}")
        passed += ["ptr null", "ptr null", "i64 0", "i64 0", f"ptr %data{i}"]
        for what, offset in (("data", DATA), ("shape", SHAPE), ("strides", STRIDES)):
            lines.append(f"%at_{what}{i} = getelementptr i8, ptr %a{i}, i64 {offset}")
            lines.append(f"%{what}{i} = load ptr, ptr %at_{what}{i}")
        for what in ("shape", "strides"):
            for k in range(of.ndim):
                lines.append(f"%at_{what}{i}.{k} = getelementptr i64, ptr %{what}{i}, i64 {k}")
                lines.append(f"%{what}{i}.{k} = load i64, ptr %at_{what}{i}.{k}")
                passed.append(f"i64 %{what}{i}.{k}")
    result = LLVM_TYPES[kernel.result]
    return "\n".join(
        [
            f'\ndefine {result} @"{kernel.name}"({", ".join(given)}) {{',
            f"%result = alloca {result}",
            "%error = alloca ptr",
            *lines,
            f'%status = call i32 @"{main}"({", ".join(passed)})',
            f"%answer = load {result}, ptr %result",
            f"ret {result} %answer",
            "}\n",
        ]
    )
