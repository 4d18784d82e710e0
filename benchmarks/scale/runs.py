"""The runs: each takes a process of its own, so that its memory is its own."""

from __future__ import annotations

import io
import os
import resource
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from .library import TETRAHEDRON
from .meshes import bytes_of, torus
from .watch import Watch


def large(
    faces: int, levels: int, parts: int | None, workers: int, memory: int, place: Path
) -> dict[str, Any]:
    """Measure `pns large`: a torus refined to so many faces outside memory; files are removed."""
    from rich.console import Console

    from service.options import Options
    from service.scale.engines.local import local
    from service.scale.large.plan import Large
    from service.scale.large.run import large_work, run_large

    control = faces // 4**levels
    # For each face made: three corners of 4 bytes, half a vertex of 24, and what the passes leave.
    needed, free = 26 * faces + bytes_of(control), shutil.disk_usage(place).free
    if needed > free:
        raise SystemExit(f"{place}: {needed / 1e9:.0f} GB are needed, {free / 1e9:.0f} are free")
    with tempfile.TemporaryDirectory(dir=place) as inside:
        source, output = Path(inside) / "in", Path(inside) / "out"
        torus(source, control)
        asked = Large(source, output, Options(levels=levels), memory, parts)
        began = time.perf_counter()
        with Watch(Path(inside)) as watch:
            engine = local(large_work(), workers)
            report, spent = run_large(asked, engine, Console(file=io.StringIO()))
        seconds = time.perf_counter() - began
    return {
        "faces": report["levels"][-1]["faces"],
        "control_faces": report["levels"][-1]["faces"] // 4**levels,
        "levels": levels,
        "parts": len(spent.part_seconds),
        "workers": workers,
        "wall_seconds": seconds,
        "seconds": spent.seconds,
        "processor_seconds": processor_seconds(),
        "driver_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "worker_bytes": spent.peak_bytes,
        "limit_distance": report["limit_distance"],
        **watch.as_dict(),
    }


def in_memory(threads: int, faces: int, levels: int) -> dict[str, Any]:
    """Measure `refine` of a torus in memory, the better of two."""
    from pns_common import Mesh, load_model, pns, refine
    from pns_common.fused import load_kernels

    load_kernels()
    with tempfile.TemporaryDirectory() as place:
        torus(Path(place) / "in", faces // 4**levels)
        arrays = (np.load(Path(place) / "in" / f"{name}.npy") for name in ("positions", "faces"))
        mesh, scheme = Mesh(*arrays), pns(load_model())
        seconds = []
        for _ in range(2):
            began = time.perf_counter()
            made = refine(mesh, scheme, levels, threads=threads)
            assert made.report["levels"]
            seconds.append(time.perf_counter() - began)
    return {"faces": len(mesh.faces) * 4**levels, "threads": threads, "seconds": min(seconds)}


def manifest(rows: int) -> dict[str, Any]:
    """Measure the driver's memory over a dry run of a manifest.

    Each second row names a missing file.
    """
    from rich.console import Console

    from service.options import Limits, Options
    from service.scale.batch import Batch, batch_work, run_batch
    from service.scale.engines.local import local

    with tempfile.TemporaryDirectory() as place, Path(os.devnull).open("w") as nowhere:
        folder = Path(place)
        (folder / "a.obj").write_bytes(TETRAHEDRON)
        with (folder / "list.txt").open("w") as lines:
            lines.writelines(f"missing/{n}.obj\n" if n % 2 else "a.obj\n" for n in range(rows))
        source, report = folder / "list.txt", folder / "report.jsonl"
        options = Options(scheme="loop")
        batch = Batch(str(source), str(folder / "out"), options, Limits(), report, dry=True)
        began = time.perf_counter()
        with Watch(folder) as watch:
            summary = run_batch(batch, local(batch_work(60.0), 1), Console(file=nowhere))
        seconds = time.perf_counter() - began
    assert summary.counts == {"planned": rows - rows // 2, "failed": rows // 2}
    return {"rows": rows, "seconds": seconds, **watch.as_dict()}


def processor_seconds() -> float:
    """Return the seconds of this process so far, and of its workers that have ended."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)
