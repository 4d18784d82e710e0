"""`pns batch` of many small files beside bare loops over them: whole commands, start to end."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from .loop import LEVELS, SCHEME

TETRAHEDRON = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
WARM = 20
# The command, and the processor time of its own process at the end.
COMMAND = """
import atexit, time
from service.cli import main
atexit.register(lambda: print(time.process_time()))
main()
"""


def library(workers: int, files: int) -> dict[str, Any]:
    """Run `pns batch` of so many small files with some workers, beside as many loops at once.

    The loops share the files, and go before and after the batch. All of them start Python, import
    what they need and load the kernels.
    """
    with tempfile.TemporaryDirectory() as place:
        source, few = Path(place) / "in", Path(place) / "few"
        for folder, count in ((source, files), (few, WARM)):
            folder.mkdir()
            for number in range(count):
                (folder / f"{number:05}.obj").write_bytes(TETRAHEDRON)
        # What is compiled or read from the disk for the first time is nobody's.
        subprocess.run([sys.executable, "-m", "pns_common.fused"], check=True, stdout=sys.stderr)
        _batch(few, Path(place) / "warm", workers)
        before = _loops(source, Path(place) / "before", workers)
        batch, driver = _batch(source, Path(place) / "out", workers)
        after = _loops(source, Path(place) / "after", workers)
        assert len(list((Path(place) / "out").iterdir())) == files
    return {
        "files": files,
        "workers": workers,
        "loop_seconds": [before[0], after[0]],
        "loop_processor_seconds": [before[1], after[1]],
        "batch_seconds": batch[0],
        "batch_processor_seconds": batch[1],
        "driver_processor_seconds": driver,
    }


def _loops(source: Path, output: Path, count: int) -> tuple[float, float]:
    """Measure the wall and processor seconds of so many bare loops at once."""
    output.mkdir()
    command = [sys.executable, "-m", "benchmarks.scale.loop", str(source), str(output)]
    spent, _ = _run([[*command, str(first), str(count)] for first in range(count)])
    return spent


def _batch(source: Path, output: Path, workers: int) -> tuple[tuple[float, float], float]:
    """Measure the wall and processor seconds of a batch, and the latter of its driver alone."""
    options = ["--scheme", SCHEME, "--levels", str(LEVELS), "--workers", str(workers)]
    report = output.with_suffix(".jsonl")
    command = [sys.executable, "-c", COMMAND, "batch", str(source), str(output), *options]
    spent, (driver,) = _run([[*command, "--report", str(report)]])
    return spent, float(driver)


def _run(commands: list[list[str]]) -> tuple[tuple[float, float], list[str]]:
    """Run commands at once; return wall and processor seconds, and what they say."""
    began, used = time.perf_counter(), _children()
    running = [subprocess.Popen(each, stdout=subprocess.PIPE, text=True) for each in commands]
    said = [process.communicate()[0] for process in running]
    spent = time.perf_counter() - began, _children() - used
    assert not any(process.returncode for process in running)
    return spent, said


def _children() -> float:
    """Return the processor seconds of the processes that this one started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
