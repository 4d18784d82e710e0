"""The smooth fans of corners, by kernels where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.blocks import available_threads
from pns_common.connectivity import smooth_fans as arrays
from pns_common.connectivity.topology import EdgeClass
from pns_common.fused import fits, kernel_blocks, kernels_loaded
from pns_common.fused.kernels.smooth_fans import join_corners


def smooth_fans(
    faces: Int[np.ndarray, "F 3"], vertex_count: int, creases: Int[np.ndarray, "N 2"] | None
) -> Int[np.ndarray, "F 3"]:
    """Return what ``pns_common.connectivity.smooth_fans`` does, in a quarter of the time.

    The kernels are not loaded for this.
    """
    if not (kernels_loaded() and fits(vertex_count, len(faces), 1)):
        return arrays.smooth_fans(faces, vertex_count, creases)
    from pns_common.fused.levels.level import control_edges

    faces = np.ascontiguousarray(faces)
    mesh = control_edges(faces, vertex_count, creases, kernel_blocks(available_threads()))
    fans = np.empty(3 * len(faces), dtype=np.int32)
    smooth = np.flatnonzero(mesh.edge_class == EdgeClass.INTERIOR).astype(np.int32)
    join_corners(mesh.half_edges, smooth, fans)
    return fans.astype(np.int64).reshape(-1, 3)
