"""`python -m benchmarks.profile`: where a refinement spends its time, on one thread."""

from __future__ import annotations

import cProfile
import time
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Annotated

import typer
from pns_common.fused import load_kernels
from pns_common.fused.library import kernel_modules, kernels_of
from rich.console import Console
from rich.table import Table

from benchmarks.generated import ORDERS
from pns_common import load_model, loop, pns, refine

ROWS = 24


def main(
    model: Annotated[str, typer.Option(help="bundled model, or loop")] = "loop",
    faces: Annotated[int, typer.Option(help="about so many")] = 320_000,
    order: Annotated[str, typer.Option(help=", ".join(ORDERS))] = "closed",
    levels: Annotated[int, typer.Option(help="depth")] = 1,
) -> None:
    """Profile a warm call by processor time."""
    load_kernels()
    name_kernels()
    mesh = ORDERS[order](faces)
    scheme = loop() if model == "loop" else pns(load_model(model))
    refine(mesh, scheme, levels, threads=1)  # warm
    profile = cProfile.Profile(time.process_time)
    profile.runcall(refine, mesh, scheme, levels, threads=1)
    # pstats would round each to a millisecond.
    own = sorted(((e.inlinetime, *named(e.code)) for e in profile.getstats()), reverse=True)
    total = sum(seconds for seconds, *_ in own)
    title = f"{model}, {len(mesh.faces):,} {order} faces × {levels}: {1000 * total:.0f} ms"
    table = Table("ms", "share", "function", "of", title=title)
    for seconds, name, file in own[:ROWS]:
        table.add_row(f"{1000 * seconds:.1f}", f"{seconds / total:.0%}", name, file)
    Console().print(table)


def named(code: CodeType | str) -> tuple[str, str]:
    """Return the name of a profiled function, and that of its module where it is not built in."""
    return (code, "") if isinstance(code, str) else (code.co_name, Path(code.co_filename).stem)


def name_kernels() -> None:
    """Give each kernel's code a frame of its own name: the profiler sees no machine code."""
    for kernel in kernels_of(kernel_modules()):

        def run(*values: object, code: Callable[..., object] = kernel.code) -> object:
            return code(*values)

        run.__code__ = run.__code__.replace(co_name=kernel.name)
        vars(kernel)["code"] = run


if __name__ == "__main__":
    typer.run(main)
