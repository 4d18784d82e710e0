"""Time and memory of `pns large` and `pns batch` on this machine: `make scale`.

    python -m benchmarks.scale                 all sizes, into scale.json, and docs/scale.png
    python -m benchmarks.scale --share .01 --results TRIAL.json --picture TRIAL.png
                                               all, at a hundredth of their sizes
    python -m benchmarks.scale large FACES     one mesh of so many refined faces
    python -m benchmarks.scale memory THREADS  one in memory, to compare with
    python -m benchmarks.scale batch WORKERS   many small files, beside bare loops over them
    python -m benchmarks.scale manifest ROWS   the driver's memory over a dry run of a manifest

Each run is a process of its own, so that its memory is its own, in the environment that --python is
of. What a size took is kept in scale.json: a size that is there already is not run again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from . import runs
from .library import library
from .plot import plot

RESULTS = Path(__file__).resolve().parent.parent / "scale.json"
PICTURE = Path(__file__).resolve().parent.parent.parent / "docs" / "scale.png"
LEVELS = 2
# Faces that are made.
SIZES = [1_300_000, 5_000_000, 20_000_000, 100_000_000]
PARTS = [2, 4, 8, 16, 32, 64]
PARTS_AT = 5_000_000
FILES = 10_000
ROWS = [50_000, 100_000]


def everything(share: float, python: str, results: Path) -> None:
    """Measure all that docs/scale.md tells, at a share of its sizes."""

    def of(size: int) -> str:
        return str(max(1, round(size * share)))

    def measured(name: str, *arguments: str) -> None:
        if name in kept(results):
            return
        command = [python, "-m", "benchmarks.scale", *arguments]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        keep(results, name, json.loads(done.stdout))
        print(name, done.stdout, flush=True)

    for threads in (1, 2):
        measured(f"memory-{threads}", "memory", str(threads), "--faces", of(SIZES[0]))
    for workers in (1, 2):
        measured(f"batch-{workers}", "batch", str(workers), "--files", of(FILES))
    for faces in SIZES:
        measured(f"large-{faces}", "large", of(faces))
    for parts in PARTS:
        measured(f"parts-{parts}", "large", of(PARTS_AT), "--parts", str(parts))
    for rows in ROWS:
        measured(f"manifest-{rows}", "manifest", of(rows))


def kept(results: Path) -> dict[str, Any]:
    """Read what was measured before."""
    return json.loads(results.read_text()) if results.exists() else {}


def keep(results: Path, name: str, made: dict[str, Any]) -> None:
    """Keep what a run took."""
    results.write_text(json.dumps(kept(results) | {name: made}, indent=1, sort_keys=True) + "\n")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", nargs="?", choices=["large", "memory", "batch", "manifest", "plot"])
    parser.add_argument("number", nargs="?", type=int, default=2)
    parser.add_argument("--share", type=float, default=1.0, help="of all sizes")
    parser.add_argument("--python", default=sys.executable, help="of the environment to measure")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--picture", type=Path, default=PICTURE)
    parser.add_argument("--levels", type=int, default=LEVELS)
    parser.add_argument("--parts", type=int)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--memory", type=int, default=2**31, help="bytes a worker may take")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()))
    parser.add_argument("--keep", action="store_true", help="in scale.json, and in the plot")
    parser.add_argument("--faces", type=int, default=SIZES[0])
    parser.add_argument("--files", type=int, default=FILES)
    given = parser.parse_args()
    match given.what:
        case "large":
            asked = given.levels, given.parts, given.workers, given.memory, given.folder
            made = runs.large(given.number, *asked)
            if given.keep:
                keep(given.results, f"large-{given.number}", made)
        case "memory":
            made = runs.in_memory(given.number, given.faces, given.levels)
        case "batch":
            made = library(given.number, given.files)
        case "manifest":
            made = runs.manifest(given.number)
        case "plot":
            plot(kept(given.results), given.picture)
            return
        case _:
            if given.share != 1 and given.results == RESULTS:
                parser.error("--share needs --results and --picture of its own")
            everything(given.share, given.python, given.results)
            plot(kept(given.results), given.picture)
            return
    print(json.dumps(made, indent=1))


if __name__ == "__main__":
    main()
