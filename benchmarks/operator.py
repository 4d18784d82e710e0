"""One level of Loop and of PNS on generated meshes, beside trimesh's Loop in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import trimesh

from benchmarks.generated import torus
from benchmarks.memory import in_fresh_process, peak_mib, reset_peak
from pns_common import load_model, loop, pns, refine


@dataclass(frozen=True)
class Measured:
    """Median seconds of a few runs, and peak memory in MiB above what stood before."""

    seconds: float
    mib: float


METHODS = ("loop", "pns", "trimesh loop")


def measure_operator(faces: int, method: str, runs: int, model: str | None = None) -> Measured:
    """Measure one method on a torus of about so many faces, in a process of its own.

    `model` is a name or a file, or the default.
    """
    return in_fresh_process(_measure, faces, method, runs, model)


def _measure(faces: int, method: str, runs: int, source: str | None) -> Measured:
    mesh = torus(faces)
    vertices, triangles = mesh.vertices.copy(), mesh.faces.copy()
    model = load_model(source)
    work: dict[str, Callable[[], object]] = {
        "loop": lambda: refine(mesh, loop(), 1, limit=False),
        "pns": lambda: refine(mesh, pns(model), 1, limit=False),
        "trimesh loop": lambda: trimesh.remesh.subdivide_loop(vertices, triangles),
    }
    work[method]()  # warm: imports, threads, the allocator
    before = peak_mib()
    reset_peak()
    before = min(before, peak_mib())
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        work[method]()
        seconds.append(time.perf_counter() - start)
    return Measured(sorted(seconds)[len(seconds) // 2], peak_mib() - before)
