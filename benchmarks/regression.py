"""`python -m benchmarks.regression`: ends with an error where refinement has become slower.

Each limit is a ratio of processor seconds to plain numpy work of the same minute (yardsticks.py),
so it holds on another machine, and in a busy hour, within the margin that it was given.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from statistics import median

from rich.console import Console
from rich.table import Table

from benchmarks.generated import torus
from benchmarks.yardsticks import numpy_second
from pns_common import load_model, loop, pns, refine
from pns_common.model.file import DEFAULT_MODEL

FACES, RUNS = 80_000, 7
# Processor seconds over the yardstick's: about twice what was measured.
LIMITS = {"loop": 0.6, DEFAULT_MODEL: 4.5}


def main() -> int:
    """Measure every limit; return how many are broken."""
    mesh = torus(FACES)
    schemes = {name: loop() if name == "loop" else pns(load_model(name)) for name in LIMITS}
    table = Table("scheme", "processor ms", "yardstick ms", "ratio", "limit")
    broken = 0
    for name, scheme in schemes.items():
        refine(mesh, scheme, 1, limit=False)  # warm
        took, yard = [], []
        for _ in range(RUNS):
            yard.append(_spent(lambda: numpy_second(FACES)))
            took.append(_spent(lambda scheme=scheme: refine(mesh, scheme, 1, limit=False)))
        ratio = median(took) / median(yard)
        broken += ratio > LIMITS[name]
        cells = (f"{1000 * median(took):.1f}", f"{1000 * median(yard):.1f}", f"{ratio:.2f}")
        table.add_row(name, *cells, f"{LIMITS[name]:g}" + ("  broken" * (ratio > LIMITS[name])))
    Console().print(table)
    return broken


def _spent(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


if __name__ == "__main__":
    sys.exit(main())
