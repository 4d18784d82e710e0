"""`python -m tests.fuzz`: malformed files by the thousand; fails on anything but a named refusal.

python -m tests.fuzz --count 100000
python -m tests.fuzz --seconds 60 --start 500000 --assets FOLDER
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from tests.fuzz.processes import in_processes
from tests.fuzz.run import ALLOWANCE, LIMITS, MIB
from tests.support.shared import SHARED


def main(
    count: Annotated[int, typer.Option(help="malformed inputs")] = 100_000,
    seconds: Annotated[float, typer.Option(help="stop after so long")] = 3600.0,
    start: Annotated[int, typer.Option(help="number of the first input")] = 0,
    processes: Annotated[int, typer.Option(help="processes that share the work")] = 2,
    assets: Annotated[Path | None, typer.Option(help="folder of glTF files")] = None,
) -> None:
    """Run the fuzzer; the number of inputs that were run is printed."""
    folder = assets or (SHARED / "assets" if (SHARED / "assets").exists() else None)
    began = time.monotonic()
    share = -(-count // processes)
    with tempfile.TemporaryDirectory() as kept:
        jobs = [
            (folder, min(share, count - n * share), seconds, start + n * share, Path(kept) / str(n))
            for n in range(processes)
        ]
        tallies = in_processes(jobs)
    outcomes = sum((tally.outcomes for tally in tallies), Counter[str]())
    for code, count_of_code in outcomes.most_common():
        typer.echo(f"{count_of_code:>9,}  {code}")
    peak = max(tally.peak for tally in tallies)
    limit = LIMITS.max_memory_bytes / MIB
    typer.echo(
        f"{sum(tally.run for tally in tallies):,} malformed inputs in "
        f"{time.monotonic() - began:.0f} s; at most {peak:.0f} MiB above the start, "
        f"where {limit:.0f} + {ALLOWANCE / MIB:.0f} are allowed"
    )
    faults = [fault for tally in tallies for fault in tally.faults]
    for name, number, what in faults[:20]:
        typer.echo(f"input {number} (from {name}): {what}", err=True)
    if faults:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
