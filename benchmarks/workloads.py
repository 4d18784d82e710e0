"""`python -m benchmarks.workloads NAME SECONDS`: one run again and again, for a profiler."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

from benchmarks.generated import quads, torus
from pns_common import catmull_clark, load_model, loop, pns, refine


def plain_loop() -> Callable[[], object]:
    """Refine 320,000 faces by one level of Loop."""
    mesh = torus(320_000)
    return lambda: refine(mesh, loop(), 1, limit=False)


def plain_quads() -> Callable[[], object]:
    """Refine 300,000 quads by one level of Catmull–Clark."""
    mesh = quads(300_000)
    return lambda: refine(mesh, catmull_clark(), 1, limit=False)


def learned_level() -> Callable[[], object]:
    """Refine 320,000 faces by one level of the default model, with its report."""
    mesh, scheme = torus(320_000), pns(load_model())
    return lambda: refine(mesh, scheme, 1, limit=False).report


def three_levels() -> Callable[[], object]:
    """Refine 20,000 faces by three levels of the default model, with the report."""
    mesh, scheme = torus(20_000), pns(load_model())
    return lambda: refine(mesh, scheme, 3, limit=False).report


def file() -> Callable[[], object]:
    """Refine a GLB of 60,000 faces twice, from bytes to bytes."""
    from service.gltf.subdivide import subdivide_gltf
    from service.meshfiles.glb import triangles_glb
    from service.meshfiles.mesh_file import of_triangles
    from service.options import Limits, Options

    mesh, model = torus(60_000), load_model()
    data = triangles_glb(of_triangles(mesh.vertices, mesh.faces))
    limits = Limits(max_faces=10**8, max_memory_bytes=10**11)
    return lambda: subdivide_gltf(data, "glb", Options(2), model, limits)


WORKLOADS = {
    work.__name__: work for work in (plain_loop, plain_quads, learned_level, three_levels, file)
}


def repeat(work: Callable[[], object], seconds: float) -> None:
    """Call it again and again: the frame that a flame graph grows from."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        work()


def main(name: str, seconds: str) -> None:
    """Make a run that loads what it needs, then repeat it."""
    work = WORKLOADS[name]()
    work()
    repeat(work, float(seconds))


if __name__ == "__main__":
    main(*sys.argv[1:])
