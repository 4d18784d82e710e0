"""`python -m benchmarks`: our refinement beside other libraries' Loop and Catmull–Clark.

python -m benchmarks                   # all cases; results.json beside this file
python -m benchmarks --largest 80000   # small meshes only, nothing written
make bench                             # sets the peers up first
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.contest import OURS, Case, contest, ours
from benchmarks.generated import ORDERS
from benchmarks.memory import MIB
from benchmarks.peers.available import available_peers
from benchmarks.startup import startup, startup_table
from pns_common.files import replace_file
from pns_common.model.file import DEFAULT_MODEL, bundled_models

RESULTS = Path(__file__).with_name("results.json")
CASES = (
    *(Case("closed", faces) for faces in (5_000, 20_000, 80_000)),
    *(Case(order, 320_000) for order in ORDERS),
    *(Case(order, 20_000, levels=3) for order in ("closed", "open", "shuffled")),
    *(Case(order, 1_300_000) for order in ("closed", "open", "shuffled")),
    Case("quads", 300_000),
)
THIS = sys.executable
# Control faces of the smaller mesh of the table of growth: 80,000 are made of them.
GROWS_FROM = 20_000
# Not one word wider than needed in a file or a pipe.
FILE_WIDTH = 150


def main(
    runs: Annotated[int, typer.Option(help="turns of each method on each mesh")] = 6,
    in_a_row: Annotated[int, typer.Option(help="runs of a turn, one right after the other")] = 1,
    largest: Annotated[int, typer.Option(help="leave out meshes above this")] = CASES[-1].faces,
    model: Annotated[list[str] | None, typer.Option(help="bundled models to measure")] = None,
    write: Annotated[bool, typer.Option(help="write results.json")] = True,
    python: Annotated[str, typer.Option(help="of the environment that ours runs in")] = THIS,
) -> None:
    """Measure every case, with the first call apart from the warm ones."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=FILE_WIDTH)
    peers, missing = available_peers()
    for name, reason in missing.items():
        console.print(f"left out: {name} ({reason})")
    names = ["loop", *(model or [DEFAULT_MODEL])]
    assert set(names) <= {"loop", *bundled_models()}, f"bundled: {bundled_models()}"
    # With the report that no other library makes, and without.
    methods = [f"{name}{report}" for name in names for report in ("", "+report")]
    commands = {f"pns {method}": ours(method, python) for method in methods} | peers
    at_once = startup(python)
    console.print(startup_table(at_once))
    done: list[dict[str, Any]] = []
    speed: dict[str, float] = {}
    for case in CASES:
        if case.faces > largest:
            continue
        outputs = case.faces * 4**case.levels
        expected = {name: rate * outputs for name, rate in speed.items()}
        contested = contest(case, commands, runs, expected, in_a_row)
        for name, method in contested["methods"].items():
            speed[name] = method["processor"] / method["made_faces"]
        done.append(contested)
        console.print(case_table(contested))
        if write:
            result = {
                "machine": machine(),
                "missing": missing,
                "startup": at_once,
                "cases": done,
            }
            replace_file(RESULTS, (json.dumps(result, indent=1) + "\n").encode())
    console.print(growth_table(done))


def growth_table(done: list[dict[str, Any]]) -> Table:
    """Return how many times longer a face takes at the largest size than at another one."""
    closed = [case for case in done if case["order"] == "closed" and case["levels"] == 1]
    small, large = ([c for c in closed if c["faces"] >= GROWS_FROM] or closed)[0], closed[-1]
    title = f"time of a face: {large['faces']:,} faces over {small['faces']:,}"
    table = Table("method", "median", "processor", title=title)
    for name in [name for name in small["methods"] if name in large["methods"]]:
        first, last = small["methods"][name], large["methods"][name]
        by = first["made_faces"] / last["made_faces"]
        table.add_row(name, *(f"{last[k] / first[k] * by:.2f}" for k in ("median", "processor")))
    return table


def case_table(contested: dict[str, Any]) -> Table:
    """Return one case as a table: seconds of every method, and ours beside the fastest peer."""
    peers = {n: m for n, m in contested["methods"].items() if not n.startswith(OURS)}
    title = f"{contested['order']}, {contested['faces']:,} faces × {contested['levels']}"
    table = Table(title=f"{title} (load {contested['load']})")
    columns = (
        "method",
        "cold s",
        "first s",
        "median s",
        "least",
        "most",
        "processor s",
        "bytes a face",
    )
    for column in columns:
        table.add_column(column, justify="left" if column == "method" else "right")
    table.add_column("fastest peer / it", justify="right")
    table.add_column("by processor", justify="right")
    fastest = min((m["median"] for m in peers.values()), default=None)
    least = min((m["processor"] for m in peers.values()), default=None)
    for name, m in contested["methods"].items():
        ratio = f"{fastest / m['median']:.2f}" if fastest else "–"
        keys = ("cold", "first", "median", "least", "most", "processor")
        space = m["mib"] * MIB / contested["faces"]
        effort = f"{least / m['processor']:.2f}" if least else "–"
        table.add_row(name, *(f"{m[k]:.3f}" for k in keys), f"{space:.0f}", ratio, effort)
    for name, reason in contested["left_out"].items():
        table.add_row(name, *["–"] * 7, reason)
    return table


def machine() -> dict[str, Any]:
    """Return what the numbers were measured on."""
    import os
    import platform

    import numpy as np

    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.processor(),
        "threads": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


if __name__ == "__main__":
    typer.run(main)
