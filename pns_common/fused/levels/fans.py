"""Vertices whose faces form more than one fan, as ``Topology.multi_fan_vertices`` finds them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.fans import count_corners, mark_multi_fan
from pns_common.fused.levels.loop_points import owners
from pns_common.fused.levels.mesh_edges import MeshEdges


def multi_fan_vertices(mesh: MeshEdges, blocks: Blocks) -> Bool[np.ndarray, " V"]:
    """Return for each vertex whether its faces form more than one fan."""
    corner, count = (np.zeros(mesh.vertex_count, dtype=np.int32) for _ in range(2))
    look = count_corners.over(mesh.faces, mesh.face_reach, ROWS, corner, count)
    owners(blocks, mesh.vertex_count).run(mesh.vertex_count, look)
    multi_fan = np.empty(mesh.vertex_count, dtype=bool)
    args = mesh.face_edges, mesh.half_edges, mesh.edge_class, corner, count
    known = mesh.sharp, int(mesh.plain)
    blocks.run(mesh.vertex_count, mark_multi_fan.over(*args, *known, ROWS, multi_fan))
    return multi_fan
