"""The kernels' machine code in memory: read from where it is kept, else compiled and kept.

The file is named by all that it was made from, so a change of a kernel's source, of a number that
it takes from elsewhere, of the compiler or of the processor asks for another one.
"""

from __future__ import annotations

import os
import pkgutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import import_module, metadata
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import llvmlite.binding  # pyright: ignore[reportMissingTypeStubs]

from pns_common.base.whole_file import replace_file
from pns_common.fused import kernels
from pns_common.fused.freed_memory import keep_freed_memory
from pns_common.fused.kernels.compiled import Kernel
from pns_common.fused.storage import kernel_file

# llvmlite ships no types.
_llvm: Any = llvmlite.binding
COMPILER = Path(__file__).with_name("compiler.py")
_opening = Lock()


@dataclass(frozen=True)
class Library:
    """Loaded code; it stays loaded as long as this."""

    jit: Any
    loaded: Any

    def __getitem__(self, name: str) -> int:
        """Return the address of a kernel."""
        return self.loaded[name]


def library() -> Library:
    """Load all kernels, once. Compiles them where that was not done before: some 15 s."""
    with _opening:
        return _library()


@cache
def _library() -> Library:
    keep_freed_memory()
    modules, file = kernel_modules(), place_of_kernels()
    code = file.read_bytes() if file.exists() else _compiled(modules, file)
    builder = _llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for kernel in kernels_of(modules):
        builder.export_symbol(kernel.name)
    jit = _llvm.create_lljit_compiler(target_machine())
    return Library(jit, builder.link(jit, kernels.__name__))


def place_of_kernels() -> Path:
    """Return the file that this processor's kernels are kept in, if there is room."""
    file = kernel_file(key_of(kernel_modules()))
    assert file is not None  # ``kernels_available`` says so
    return file


def _compiled(modules: Sequence[ModuleType], file: Path) -> bytes:
    """Compile all kernels, and keep them in a file where there is room."""
    # numba itself is not needed before.
    from pns_common.fused.compiler import compile_kernels

    code = compile_kernels(modules)
    # A full disk costs the next process its time, and this one nothing.
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, code)
    return code


def kernel_modules() -> list[ModuleType]:
    """Return the modules that define kernels."""
    names = sorted(module.name for module in pkgutil.iter_modules(kernels.__path__))
    return [import_module(f"{kernels.__name__}.{name}") for name in names]


def kernels_of(modules: Sequence[ModuleType]) -> list[Kernel]:
    """Return the kernels that the modules define."""
    return [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, Kernel) and value.function.__module__ == module.__name__
    ]


def target_machine() -> Any:
    """Return the processor that code is made for: this one, or that of NUMBA_CPU_NAME."""
    _llvm.initialize_native_target()
    _llvm.initialize_native_asmprinter()
    name, features = processor()
    target = _llvm.Target.from_default_triple()
    # Position-independent, since it is loaded anywhere.
    return target.create_target_machine(cpu=name, features=features, opt=3, reloc="pic")


def processor() -> tuple[str, str]:
    """Return the processor's name and its features, as LLVM calls them."""
    name, features = (os.environ.get(f"NUMBA_CPU_{what}") for what in ("NAME", "FEATURES"))
    if features is None:
        features = "" if name else _llvm.get_host_cpu_features().flatten()
        if "+avx512f" in features:
            # LLVM would take half of what such a processor can at once.
            features += ",-prefer-256-bit"
    return name or _llvm.get_host_cpu_name(), features


def key_of(modules: Sequence[ModuleType]) -> str:
    """Return what tells the code of these modules from any other."""
    parts = [_llvm.get_default_triple(), *processor(), object.__basicsize__]
    parts += [metadata.version("numba"), metadata.version("llvmlite")]
    parts += [COMPILER.read_bytes()]
    for module in modules:
        assert module.__file__ is not None
        numbers = {k: v for k, v in vars(module).items() if isinstance(v, int | float)}
        parts += [module.__name__, Path(module.__file__).read_bytes(), sorted(numbers.items())]
    return sha256(repr(parts).encode()).hexdigest()[:16]
