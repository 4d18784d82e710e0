"""Time and memory of `pns large` and `pns batch` on this machine: `make scale`.

    python -m benchmarks.scale                 all sizes, into scale.json, and docs/scale.png
    python -m benchmarks.scale --share .01     all, at a hundredth of their sizes, kept nowhere
    python -m benchmarks.scale large FACES     one mesh of so many refined faces
    python -m benchmarks.scale memory THREADS  one in memory, to compare with
    python -m benchmarks.scale batch WORKERS   many small files, beside a bare loop over them
    python -m benchmarks.scale manifest ROWS   the driver's memory over a dry run of a manifest

Each run is a process of its own, so that its memory is its own. What a size took is kept in
scale.json: a size that is there already is not run again.
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
from .plot import plot

RESULTS = Path(__file__).resolve().parent.parent / "scale.json"
PLOT = Path(__file__).resolve().parent.parent.parent / "docs" / "scale.png"
LEVELS = 2
# Faces that are made.
SIZES = [1_300_000, 5_000_000, 20_000_000, 100_000_000]
PARTS = [2, 4, 8, 16, 32, 64]
PARTS_AT = 5_000_000
FILES = 10_000
ROWS = [50_000, 100_000]


def everything(share: float, results: Path, picture: Path) -> None:
    """All that docs/scale.md tells, at a share of its sizes."""

    def of(size: int) -> str:
        return str(max(1, round(size * share)))

    for threads in (1, 2):
        measured(results, f"memory-{threads}", "memory", str(threads), "--faces", of(SIZES[0]))
    for faces in SIZES:
        measured(results, f"large-{faces}", "large", of(faces))
    for parts in PARTS:
        measured(results, f"parts-{parts}", "large", of(PARTS_AT), "--parts", str(parts))
    for workers in (1, 2):
        measured(results, f"batch-{workers}", "batch", str(workers), "--files", of(FILES))
    for rows in ROWS:
        measured(results, f"manifest-{rows}", "manifest", of(rows))
    plot(kept(results), picture)


def measured(results: Path, name: str, *arguments: str) -> None:
    """Run a measurement in a process of its own, unless it is kept, and keep it."""
    if name in kept(results):
        return
    command = [sys.executable, "-m", "benchmarks.scale", *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    keep(results, name, json.loads(done.stdout))
    print(name, done.stdout, flush=True)


def kept(results: Path) -> dict[str, Any]:
    """What was measured before."""
    return json.loads(results.read_text()) if results.exists() else {}


def keep(results: Path, name: str, made: dict[str, Any]) -> None:
    """Keep what a run took."""
    results.write_text(json.dumps(kept(results) | {name: made}, indent=1, sort_keys=True) + "\n")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", nargs="?", choices=["large", "memory", "batch", "manifest", "plot"])
    parser.add_argument("number", nargs="?", type=int, default=2)
    parser.add_argument("--share", type=float, default=1.0, help="of all sizes; 1 is kept")
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
                keep(RESULTS, f"large-{given.number}", made)
        case "memory":
            made = runs.in_memory(given.number, given.faces, given.levels)
        case "batch":
            made = runs.library(given.number, given.files)
        case "manifest":
            made = runs.manifest(given.number)
        case "plot":
            plot(kept(RESULTS), PLOT)
            return
        case _ if given.share == 1:
            everything(1.0, RESULTS, PLOT)
            return
        case _:
            with tempfile.TemporaryDirectory() as place:
                everything(given.share, Path(place) / "scale.json", Path(place) / "scale.png")
            return
    print(json.dumps(made, indent=1))


if __name__ == "__main__":
    main()
