"""Time and memory of `pns large` and `pns batch` on this machine: `make scale`.

    python -m benchmarks.scale               all sizes, into scale.json, and docs/scale.png
    python -m benchmarks.scale large FACES   one mesh of so many refined faces (two levels)
    python -m benchmarks.scale batch WORKERS 10,000 small files, beside a bare loop over them

Each run is a process of its own, so that its memory is its own. What a size took is kept in
scale.json beside this file: a size that is there already is not run again.
"""

from __future__ import annotations

import io
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).with_name("scale.json")
PLOT = Path(__file__).resolve().parent.parent / "docs" / "scale.png"
LEVELS = 2
# Faces that are made.
SIZES = [1_300_000, 5_000_000, 20_000_000, 100_000_000]
PARTS = [2, 4, 8, 16, 32, 64]
PARTS_AT = 5_000_000
FILES = 10_000


def torus(folder: Path, faces: int) -> None:
    """Write a bumpy torus of about so many faces as a folder of arrays, row by row."""
    side = max(3, round(math.sqrt(faces / 2)))
    folder.mkdir(parents=True)
    shape = (side * side, 3), (2 * side * side, 3)
    kinds = np.float64, np.int32
    names = "positions.npy", "faces.npy"
    points, corners = (
        np.lib.format.open_memmap(folder / name, "w+", kind, rows)
        for name, kind, rows in zip(names, kinds, shape, strict=True)
    )
    v = np.arange(side)
    b = v * (2 * np.pi / side)
    for u in range(side):
        a = u * (2 * np.pi / side)
        r = 0.35 * (1 + 0.08 * np.sin(9 * a) * np.cos(7 * b) + 0.02 * np.sin(61 * a + 3 * b))
        ring = 1 + r * np.cos(b)
        rows = slice(u * side, (u + 1) * side)
        points[rows] = np.stack([ring * np.cos(a), ring * np.sin(a), r * np.sin(b)], axis=1)
        here, across = u * side + v, (u + 1) % side * side + v
        on, diagonal = u * side + (v + 1) % side, (u + 1) % side * side + (v + 1) % side
        pair = np.stack([here, across, diagonal, here, diagonal, on], axis=1)
        corners[2 * rows.start : 2 * rows.stop] = pair.reshape(-1, 3)


def large(faces: int, parts: int | None, workers: int, memory: int, place: Path) -> dict[str, Any]:
    """Refine a torus outside memory; what it took."""
    from rich.console import Console

    from service.options import Options
    from service.scale.engines.local import local
    from service.scale.large.plan import Large
    from service.scale.large.run import large_work, run_large

    source, output = place / "in", place / "out"
    if not source.exists():
        torus(source, faces // 4**LEVELS)
    asked = Large(source, output, Options(levels=LEVELS), memory, parts)
    report, spent = run_large(asked, local(large_work(), workers), Console(file=io.StringIO()))
    driver = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "faces": report["levels"][-1]["faces"],
        "parts": len(spent.part_seconds),
        "workers": workers,
        "seconds": spent.seconds,
        "processor_seconds": processor_seconds(),
        "driver_bytes": driver.ru_maxrss * 1024,
        "worker_bytes": spent.peak_bytes,
        "limit_distance": report["limit_distance"],
    }


def processor_seconds() -> float:
    """Of this process so far, and of its workers that have ended."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def in_memory(threads: int) -> dict[str, Any]:
    """`refine` of the first size in memory, the better of two."""
    from pns_common import Mesh, load_model, pns, refine
    from pns_common.fused import load_kernels

    load_kernels()
    with tempfile.TemporaryDirectory() as place:
        torus(Path(place) / "in", SIZES[0] // 4**LEVELS)
        arrays = (np.load(Path(place) / "in" / f"{name}.npy") for name in ("positions", "faces"))
        mesh, scheme = Mesh(*arrays), pns(load_model())
        seconds = []
        for _ in range(2):
            began = time.perf_counter()
            made = refine(mesh, scheme, LEVELS, threads=threads)
            assert made.report["levels"]
            seconds.append(time.perf_counter() - began)
    faces = len(mesh.faces) * 4**LEVELS
    return {"faces": faces, "threads": threads, "seconds": min(seconds)}


def library(workers: int, files: int) -> dict[str, Any]:
    """`pns batch` of so many small files, beside a bare loop over the same.

    The loop asks for the report of each file too, whose certificate is in the batch's rows.
    """
    from rich.console import Console

    from service.meshfiles.convert import converted
    from service.options import Limits, Options
    from service.scale.batch import Batch, batch_work, run_batch
    from service.scale.engines.local import local

    mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    options = Options(scheme="loop", levels=3)
    with tempfile.TemporaryDirectory() as place:
        source, output = Path(place) / "in", Path(place) / "out"
        source.mkdir()
        for number in range(files):
            (source / f"{number:05}.obj").write_bytes(mesh)
        bare = Path(place) / "bare"
        bare.mkdir()
        # What is imported or compiled at the first call is not of the loop.
        converted(mesh, "obj", "obj", options, None, Limits())
        began, used = time.perf_counter(), processor_seconds()
        for path in sorted(source.iterdir()):
            made = converted(path.read_bytes(), "obj", "obj", options, None, Limits())
            assert made.report["levels"]
            (bare / path.name).write_bytes(made.content)
        loop, loop_processor = time.perf_counter() - began, processor_seconds() - used
        report = Path(place) / "report.jsonl"
        batch = Batch(str(source), str(output), options, Limits(), report)
        began, used = time.perf_counter(), processor_seconds()
        summary = run_batch(batch, local(batch_work(60.0), workers), Console(file=io.StringIO()))
        took, took_processor = time.perf_counter() - began, processor_seconds() - used
        assert summary.counts == {"done": files}
    return {
        "files": files,
        "workers": workers,
        "loop_seconds": loop,
        "loop_processor_seconds": loop_processor,
        "batch_seconds": took,
        "batch_processor_seconds": took_processor,
    }


def measured(name: str, *arguments: str) -> None:
    """Run a measurement in a process of its own, unless it is kept, and keep it."""
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if name in known:
        return
    command = [sys.executable, "-m", "benchmarks.scale", *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    known[name] = json.loads(done.stdout.splitlines()[-1])
    RESULTS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
    print(name, known[name])


def plot() -> None:
    """Growth with faces and with parts, as docs/scale.md shows it."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot as plt

    known = json.loads(RESULTS.read_text())
    by_size = sorted(
        (run for name, run in known.items() if name.startswith("large")), key=lambda r: r["faces"]
    )
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    faces = [r["faces"] for r in by_size]
    axes[0].loglog(faces, [sum(r["seconds"].values()) for r in by_size], "o-", label="wall")
    axes[0].loglog(faces, [r["processor_seconds"] for r in by_size], "s--", label="processor")
    axes[0].set(xlabel="faces made", ylabel="seconds", title="Time, two workers")
    axes[1].semilogx(faces, [r["worker_bytes"] / 2**20 for r in by_size], "o-", label="a worker")
    axes[1].semilogx(faces, [r["driver_bytes"] / 2**20 for r in by_size], "s--", label="the driver")
    axes[1].set(xlabel="faces made", ylabel="MiB resident", title="Memory", ylim=0)
    cut = sorted(
        (run for name, run in known.items() if name.startswith("parts")), key=lambda r: r["parts"]
    )
    parts = [r["parts"] for r in cut]
    axes[2].semilogx(
        parts, [r["processor_seconds"] for r in cut], "o-", base=2, label="processor s"
    )
    axes[2].semilogx(
        parts, [r["worker_bytes"] / 2**26 for r in cut], "s--", base=2, label="a worker, 64 MiB"
    )
    axes[2].set(xlabel="parts", title=f"{PARTS_AT / 1e6:.0f} M faces", ylim=0)
    for axis in axes:
        axis.legend()
        axis.grid(alpha=0.3)
    figure.savefig(PLOT, dpi=110)


def everything() -> None:
    """All that docs/scale.md tells."""
    for threads in (1, 2):
        measured(f"memory-{threads}", "memory", str(threads))
    for faces in SIZES:
        measured(f"large-{faces}", "large", str(faces))
    for parts in PARTS:
        measured(f"parts-{parts}", "large", str(PARTS_AT), "--parts", str(parts))
    for workers in (1, 2):
        measured(f"batch-{workers}", "batch", str(workers))
    plot()


def main() -> None:
    """The command line."""
    import argparse

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="?", choices=["large", "memory", "batch", "plot"])
    parser.add_argument("number", nargs="?", type=int, default=2)
    parser.add_argument("--parts", type=int)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--memory", type=int, default=2**31)
    given = parser.parse_args()
    match given.what:
        case "large":
            with tempfile.TemporaryDirectory() as place:
                print(
                    json.dumps(
                        large(given.number, given.parts, given.workers, given.memory, Path(place))
                    )
                )
        case "memory":
            print(json.dumps(in_memory(given.number)))
        case "batch":
            print(json.dumps(library(given.number, FILES)))
        case "plot":
            plot()
        case _:
            everything()


if __name__ == "__main__":
    main()
