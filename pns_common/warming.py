"""Compile or load the kernels before they are needed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from pns_common import kernels
from pns_common.mesh import Mesh
from pns_common.model.file import load_model
from pns_common.refinement import refine
from pns_common.schemes import loop, pns

ANNOUNCEMENT = "Compiling kernels, once: some fifteen seconds"


def kernels_are_cached() -> bool:
    """Return whether compiled code is kept beside the sources from an earlier run."""
    return any((Path(kernels.__file__).parent / "__pycache__").glob("*.nbc"))


def warm_up(announce: Callable[[str], None] = print) -> None:
    """Run everything once on small meshes, so that later calls find all kernels compiled.

    ``announce`` is called with a sentence if they must be compiled first, which takes seconds;
    loading them takes half a second.
    """
    if not kernels_are_cached():
        announce(ANNOUNCEMENT)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], dtype=float)
    closed, sheet = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], [[0, 1, 2], [2, 1, 3]]
    scheme = pns(load_model())
    for faces in (closed, sheet):
        made = refine(Mesh(vertices, faces), scheme, levels=2, limit=True, creases=None)
        assert made.report["levels"]
    refine(Mesh(vertices, closed), loop(), creases=np.array([[0, 1], [1, 2]]), limit=True)
