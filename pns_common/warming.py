"""Compile or load the kernels before they are needed: ``python -m pns_common.warming``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from pns_common.kernels import are_compiled
from pns_common.mesh.mesh import Mesh
from pns_common.model.file import load_model
from pns_common.operator.scheme import catmull_clark, loop, pns
from pns_common.progress import compiling
from pns_common.refinement import refine

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], dtype=float)
CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CLOSED, SHEET = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], [[0, 1, 2], [2, 1, 3]]


def warm_up(
    announce: Callable[[str], None] = print,
    progress: Callable[[int, int], None] = lambda done, total: None,
    more: Iterable[Callable[[], object]] = (),
) -> int:
    """Run every kernel once on small meshes, so that later calls find it compiled.

    Args:
        announce: called with a sentence if kernels must be compiled first, which takes seconds, and
            now and then meanwhile; loading them takes half a second.
        progress: called with (stages done, stages in all).
        more: stages that follow those of this package.

    Returns the number of kernels that were compiled.
    """
    stages = [*_stages(), *more]
    with compiling(announce) as compiled:
        for done, run in enumerate(stages, start=1):
            compiled.place = f", step {done} of {len(stages)}"
            run()
            progress(done, len(stages))
    return compiled.kernels


def _stages() -> Iterator[Callable[[], object]]:
    """Yield refinements that reach all kernels between them, the cheapest to compile first."""
    sheet, closed, crease = Mesh(VERTICES, SHEET), Mesh(VERTICES, CLOSED), np.array([[0, 1]])
    yield lambda: refine(closed, loop(), 1)
    yield lambda: refine(closed, loop(), 2).report
    yield lambda: refine(sheet, loop(), creases=crease[:0])
    yield lambda: refine(closed, loop(), creases=crease).report
    yield lambda: refine(closed, pns(load_model()), 1, creases=None)
    yield lambda: refine(sheet, pns(load_model()), 2).report
    yield lambda: refine(closed, pns(load_model("paper")), 1).report
    yield lambda: refine(sheet, loop(), 1, limit=True)
    yield lambda: refine(closed, loop(), 1, limit=True, creases=crease)
    yield lambda: refine(Mesh(VERTICES, CLOSED[:3]), catmull_clark(), 2, creases=crease).report
    quads = Mesh(CUBE, QUADS)
    yield lambda: refine(quads, pns(load_model()), 1).report
    yield lambda: refine(quads, pns(load_model()), 1, creases=None, limit=True)


if __name__ == "__main__":
    from rich.progress import Progress

    with Progress(transient=True, disable=are_compiled() or not sys.stderr.isatty()) as bar:
        task = bar.add_task("Compiling kernels", total=None)
        warm_up(print, lambda done, total: bar.update(task, completed=done, total=total))
