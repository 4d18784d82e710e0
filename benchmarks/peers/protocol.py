"""Protocol of the Python peers: see driver.hpp, whose file and whose lines these are.

Imported in the peers' own environment too: numpy and the standard library only.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np


def write_mesh(path: Path, points: np.ndarray, faces: np.ndarray) -> None:
    """Write a mesh as every peer reads it: counts, float64 points, int32 faces of one degree."""
    with path.open("wb") as file:
        np.array([len(points), len(faces)], dtype=np.int64).tofile(file)
        np.ascontiguousarray(points, dtype=np.float64).tofile(file)
        np.ascontiguousarray(faces, dtype=np.int32).tofile(file)


def read_mesh(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Read points (V, 3) float64 and faces (F, 3) or (F, 4) int32."""
    with Path(path).open("rb") as file:
        vertices, faces = np.fromfile(file, dtype=np.int64, count=2)
        points = np.fromfile(file, dtype=np.float64, count=3 * vertices)
        return points.reshape(-1, 3), np.fromfile(file, dtype=np.int32).reshape(faces, -1)


def status_kib(name: str) -> int:
    """Return a line of the process's status, in KiB (Linux)."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1])
    return 0


def serve(refine: Callable[[], tuple[np.ndarray, np.ndarray]]) -> None:
    """Make a run for each line that says so, and print what it took."""
    for line in sys.stdin:
        if line.strip() != "run":
            return
        Path("/proc/self/clear_refs").write_text("5")
        before = status_kib("VmRSS:")
        wall, processor = time.perf_counter(), time.process_time()
        points, faces = refine()
        seconds, spent = time.perf_counter() - wall, time.process_time() - processor
        mib = (status_kib("VmHWM:") - before) / 1024
        made = {"vertices": len(points), "faces": len(faces)}
        since_start = time.process_time()
        took = {"seconds": seconds, "processor": spent, "processor_since_start": since_start}
        print(json.dumps(took | {"mib": mib} | made), flush=True)
