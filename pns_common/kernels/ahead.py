"""Compile the loops ahead of time: ``python -P ahead.py FOLDER``, as setup.py does.

numba compiles each loop, for each type that its parameters take, into LLVM's language
(``inspect_llvm``); llvmlite makes an object file of it; the C compiler links all with dispatch.c.
The objects call nothing of Python or numba, so the module needs neither and suits every Python
from 3.11 on.
"""

from __future__ import annotations

import inspect
import os
import re
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from itertools import count, product
from multiprocessing import get_context
from pathlib import Path
from types import FunctionType
from typing import Any, get_type_hints

# Before numba is imported: code for every processor of the architecture, which gives the same bits,
# and optimised once, here.
os.environ.update(
    KERNELS_JIT="ahead", NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_OPT="0"
)

import llvmlite.binding as llvm
import numpy as np
from numba import carray, cfunc, from_dtype, types

from pns_common.kernels import HERE, ArrayType, Connectivity, sources_digest

# Loops of a module are left to one process, which compiles what they share once.
CHUNK = 8
# How dispatch.c writes what a loop returns.
RESULTS = {
    types.none: "",
    types.boolean: "b",
    types.int64: "i",
    types.float64: "f",
    types.UniTuple(types.int64, 2): "ii",
}
# Pointers to arrays, whole numbers (the arrays' shapes among them), and fractions.
ENTRY = types.void(
    types.CPointer(types.voidptr), types.CPointer(types.int64), types.CPointer(types.float64)
)
# numba's counting of references, and what the C library gives to a loop.
COUNTING = re.compile(r"^(define[^\n]* @NRT_(?:incref|decref)\([^\n]*) \{.*?^\}", re.M | re.S)
MATHEMATICS = {
    "acos",
    "asin",
    "atan",
    "atan2",
    "cos",
    "exp",
    "log",
    "pow",
    "sin",
    "sqrt",
    "tan",
    "tanh",
}
# Types of a mesh's fields.
FIELDS = tuple(get_type_hints(Connectivity).values())
STORE = {"": "{}", "b": "n[0] = {}", "i": "n[0] = {}", "f": "x[0] = {}", "ii": "n[0], n[1] = {}"}


def loops() -> Iterator[tuple[str, str, tuple[Any, ...]]]:
    """Yield each loop as its module, its name and the types of its parameters.

    Raises:
        TypeError: a parameter has no type.
    """
    for path in sorted(HERE.glob("[!_]*.py")):
        if path.stem == Path(__file__).stem:
            continue
        for name, loop in vars(import_module(f"pns_common.kernels.{path.stem}")).items():
            function: FunctionType | None = getattr(loop, "py_func", None)
            here = function is not None and function.__module__.endswith(f".{path.stem}")
            if not here or loop.targetoptions.get("forceinline"):
                continue
            given = inspect.get_annotations(function, eval_str=True)
            if missing := inspect.signature(function).parameters.keys() - given.keys():
                raise TypeError(f"{path}: {name} has parameters without a type: {sorted(missing)}")
            each = (t if isinstance(t, tuple) else (t,) for t in given.values())
            yield from ((path.stem, name, chosen) for chosen in product(*each))


def compile_loop(module: str, name: str, given: tuple[Any, ...], to: Path) -> tuple[str, str, str]:
    """Compile one loop for some types into an object file, with one function of the file's name.

    Returns its name for Python, its parameters and its result, as dispatch.c reads them.
    """
    loop = getattr(import_module(f"pns_common.kernels.{module}"), name)
    loop.compile(tuple(map(_type, given)))
    result = RESULTS[loop.nopython_signatures[-1].return_type]
    parameters, places = list[str](), {kind: count() for kind in "pnx"}

    def expression(type_: Any) -> str:
        """Return what reads an argument in the entry."""
        if type_ is Connectivity:
            return f"Connectivity({', '.join(map(expression, FIELDS))})"
        if isinstance(type_, ArrayType):
            parameters.append(f"{type_.dtype}_{type_.axes}d, ")
            shape = "".join(f"n[{next(places['n'])}]," for _ in range(type_.axes))
            return f"carray(p[{next(places['p'])}], ({shape}), np.dtype('{type_.dtype}'))"
        parameters.append(f"{type_.__name__}, ")
        if type_ is float:
            return f"x[{next(places['x'])}]"
        return f"n[{next(places['n'])}]" + " != 0" * (type_ is bool)

    called = STORE[result].format(f"loop({', '.join(map(expression, given))})")
    made: dict[str, Any] = {"loop": loop, "carray": carray, "np": np, "Connectivity": Connectivity}
    exec(f"def entry(p, n, x):\n    {called}", made)
    entry = cfunc(ENTRY, nopython=True, error_model="numpy")(made["entry"])
    to.write_bytes(_object(entry.inspect_llvm(), entry.native_name, to.stem))
    return f"{module}.{name}", "".join(parameters), result


def _type(given: Any) -> types.Type:
    """Return numba's type of a parameter's."""
    if given is Connectivity:
        return types.NamedTuple(tuple(map(_type, FIELDS)), Connectivity)
    if isinstance(given, ArrayType):
        return types.Array(from_dtype(np.dtype(given.dtype)), given.axes, "C")
    return {bool: types.boolean, int: types.int64, float: types.float64}[given]


def _object(ir: str, wrapper: str, name: str) -> bytes:
    """Return an object file of position-independent code with one function of a given name.

    Raises:
        TypeError: the loop needs more than its arguments and mathematics, memory say.
    """
    # Arrays are borrowed: there is nothing to count references of.
    module = llvm.parse_assembly(COUNTING.sub(r"\1 { ret void }", ir))
    # numba's wrapper reports errors through Python; what it calls returns a status.
    native = wrapper.removeprefix("cfunc.")
    for symbol in (*module.functions, *module.global_variables):
        if not symbol.is_declaration and symbol.name != native:
            symbol.linkage = "internal"
    module.get_function(native).name = name
    module.get_function(name).visibility = "hidden"
    machine = llvm.Target.from_triple(module.triple).create_target_machine(opt=3, reloc="pic")
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    optimiser = llvm.create_pass_builder(machine, tuning)
    optimiser.getModulePassManager().run(module, optimiser)
    outside = {symbol.name for symbol in module.functions if symbol.is_declaration}
    if unknown := {n for n in outside if not n.startswith("llvm.")} - MATHEMATICS:
        raise TypeError(f"{wrapper} calls {sorted(unknown)}")
    return machine.emit_object(module)


def compile_all(folder: Path) -> None:
    """Compile every loop into objects in a folder, and the table of them, loops.h."""
    folder.mkdir(parents=True, exist_ok=True)
    every = list(loops())
    objects = [folder / f"pns_loop_{number}.o" for number in range(len(every))]
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        made = list(pool.map(compile_loop, *zip(*every, strict=True), objects, chunksize=CHUNK))
    lines = [f'#define DIGEST "{sources_digest()}"']
    lines += [f"extern Entry {path.stem};" for path in objects]
    rows = zip(made, objects, strict=True)
    table = [f'{{"{n}", "{p}", "{r}", {path.stem}}},' for (n, p, r), path in rows]
    lines += ["static const Loop LOOPS[] = {", *table, "};"]
    (folder / "loops.h").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    compile_all(Path(sys.argv[1]))
