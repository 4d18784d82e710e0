"""Several methods on one mesh in the same minutes: each in its process, one run each in turn."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.generated import ORDERS
from benchmarks.peers.protocol import write_mesh
from benchmarks.yardsticks import copy_bandwidth, sgemm_rate

ROOT = Path(__file__).resolve().parents[1]
# What the names of our methods start with.
OURS = "pns "
# A method whose first run takes this many times the fastest's makes no second one.
SLOW = 12
# Nor is it started on a mesh on which, by its last size, it would take more processor seconds.
LONGEST = 5.0


@dataclass(frozen=True)
class Case:
    """One mesh, refined so often."""

    order: str
    faces: int
    levels: int = 1


class Contestant:
    """A process that refines one mesh on request."""

    def __init__(self, command: Sequence[str], mesh: Path, levels: int):
        self._process = subprocess.Popen(
            [*command, str(mesh), str(levels)],
            cwd=ROOT,
            env=as_installed(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.runs: list[dict[str, Any]] = []
        self._started = time.perf_counter()
        self.cold = 0.0

    def run(self) -> bool:
        """Make a run; False where the method failed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write("run\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not self.runs:
            self.cold = time.perf_counter() - self._started
        if line:
            self.runs.append(json.loads(line))
        return bool(line)

    def stop(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


def as_installed() -> dict[str, str]:
    """Return an environment that keeps modules compiled, as an installed package's are."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def contest(
    case: Case,
    commands: Mapping[str, Sequence[str]],
    rounds: int,
    expected: Mapping[str, float],
    in_a_row: int = 1,
) -> dict[str, Any]:
    """Measure all methods on a case, interleaved.

    Args:
        commands: how each method is started, by name.
        rounds: turns of each; the first is the first call, the rest are warm.
        in_a_row: runs of a warm turn, one right after the other.
        expected: processor seconds that a method would take, by an earlier size.
    """
    mesh = ORDERS[case.order](case.faces)
    left_out = {n: "too slow at this size" for n in commands if expected.get(n, 0) > LONGEST}
    copies: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh"
        write_mesh(path, mesh.vertices, mesh.faces)
        playing: dict[str, Contestant] = {}
        for name, command in commands.items():
            if name not in left_out:
                # One after the other: a start is part of what is measured.
                contestant = Contestant(command, path, case.levels)
                if contestant.run():
                    playing[name] = contestant
                else:
                    contestant.stop()
                    left_out[name] = "failed"
        fastest = min(c.runs[0]["processor"] for c in playing.values())
        for _ in range(1, rounds):
            copies.append(copy_bandwidth())
            for name, contestant in playing.items():
                # Ours loads its kernels in the first call.
                if name.startswith(OURS) or contestant.runs[0]["processor"] < SLOW * fastest:
                    for _ in range(in_a_row):
                        contestant.run()
        for contestant in playing.values():
            contestant.stop()
    return {
        "order": case.order,
        "faces": len(mesh.faces),
        "levels": case.levels,
        "in_a_row": in_a_row,
        "load": round(os.getloadavg()[0], 1),
        "copy_bytes_per_second": median(copies),
        "sgemm_flops_per_second": sgemm_rate(),
        "left_out": left_out,
        "methods": {name: summary(c) for name, c in playing.items()},
    }


def summary(contestant: Contestant) -> dict[str, Any]:
    """Return the first call, and of the warm ones (or the only one) the median and the extremes.

    ``cold`` counts from the start of the process, imports and the reading of the mesh included.
    """
    runs = contestant.runs
    warm = [run["seconds"] for run in runs[1:]] or [runs[0]["seconds"]]
    processor = [run["processor"] for run in runs[1:]] or [runs[0]["processor"]]
    return {
        "cold": contestant.cold,
        "cold_processor": runs[0]["processor_since_start"],
        "first": runs[0]["seconds"],
        "first_processor": runs[0]["processor"],
        "median": median(warm),
        "least": min(warm),
        "most": max(warm),
        "processor": min(processor),
        "mib": max(run["mib"] for run in runs),
        "runs": len(runs),
        "made_faces": runs[0]["faces"],
        "made_vertices": runs[0]["vertices"],
    }


def ours(name: str, python: str) -> list[str]:
    """Return how our method is started, by the Python of an environment that has the library."""
    return [python, "-m", "benchmarks.ours", name]
