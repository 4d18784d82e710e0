"""Compile or load all kernels, those that files need too: ``python -m service.warming``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pns_common import load_model
from pns_common import warm_up as warm_up_library
from pns_common.warming import CLOSED, VERTICES

from .gltf.subdivide import subdivide_gltf
from .meshfiles.glb import triangles_glb
from .meshfiles.mesh_file import COLOUR, Layer, of_triangles
from .options import Limits, Options


def warm_up(announce: Callable[[str], None]) -> int:
    """Run every kernel once, so that no job waits for a compiler; `announce` as in pns_common.

    Returns the number of kernels that were compiled.
    """
    file, model = _rigged(), load_model()
    files = [
        partial(subdivide_gltf, file, "glb", options, model, Limits())
        for options in (
            Options(),
            Options(levels=1, normals="smooth", uv="smooth", weld_tolerance=0.001),
        )
    ]
    return warm_up_library(announce, more=files)


def _rigged() -> bytes:
    """Return a tetrahedron with all attributes that have kernels of their own, as a GLB."""
    mesh = of_triangles(VERTICES, np.array(CLOSED), VERTICES[:, :2], VERTICES - VERTICES.mean(0))
    count = len(VERTICES)
    joints = np.tile(np.arange(4, dtype=np.uint8), (count, 1))
    weights = np.full((count, 4), 0.25, np.float32)
    tangents = np.tile(np.array([1, 0, 0, 1], np.float32), (count, 1))
    values = {
        "TANGENT": tangents,
        COLOUR: np.full((count, 4), 255, np.uint8),
        "JOINTS_0": joints,
        "WEIGHTS_0": weights,
    }
    layers = {name: Layer(value, mesh.corners) for name, value in values.items()}
    return triangles_glb(replace(mesh, layers={**mesh.layers, **layers}))


if __name__ == "__main__":
    warm_up(partial(print, flush=True))
