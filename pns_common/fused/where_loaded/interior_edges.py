"""The interior edges of a face list, by kernels where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.blocks import available_threads
from pns_common.connectivity.topology import build_topology
from pns_common.fused import fits, kernel_blocks, kernels_loaded


def interior_edges(
    faces: Int[np.ndarray, "F 3"], vertex_count: int
) -> tuple[Int[np.ndarray, "I 2"], Int[np.ndarray, "I 2"]]:
    """Return the interior edges and their half-edges, as a topology numbers them.

    The numbers of kernels have 32 bits. They are not loaded for this.
    """
    if not (kernels_loaded() and fits(vertex_count, len(faces), 1)):
        topology = build_topology(faces, vertex_count)
        return topology.edges[topology.interior], topology.half_edges[topology.interior]
    from pns_common.fused.levels.mesh_edges import build_edges

    blocks = kernel_blocks(available_threads())
    mesh = build_edges(np.ascontiguousarray(faces, dtype=np.int32), vertex_count, blocks)
    rows = mesh.interior if len(mesh.sharp_edges) else slice(None)
    return mesh.edges[rows], mesh.half_edges[rows]
