"""The crease lines of a level, as ``pns_common.geometry.crease_lines`` finds them."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.creases import (
    drop_loose_ends,
    mark_edges_beyond,
    mark_flat_sides,
)
from pns_common.fused.mesh_edges import MeshEdges
from pns_common.geometry.crease_lines import at_others


def crease_line_rows(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    angle: float,
    blocks: Blocks,
) -> Int[np.ndarray, " N"]:
    """Return the edges of the crease lines; ``normals`` are the faces', ``angle`` θ in degrees."""
    cosine, count = math.cos(math.radians(angle)), len(mesh.edges)
    beyond, found = np.empty(count, dtype=bool), np.zeros(blocks.count(count), dtype=np.int64)
    around = normals, mesh.half_edges, mesh.edge_class, cosine
    mark_beyond = mark_edges_beyond.over(*around, ROWS, beyond)

    def mark(rows: slice) -> None:
        found[blocks.number(rows, count)] = mark_beyond(rows)

    blocks.run(count, mark)
    if not found.any():
        return np.zeros(0, dtype=np.int32)
    sharp = np.flatnonzero(beyond).astype(np.int32)
    is_flat = np.empty(len(sharp), dtype=bool)
    sides = normals, mesh.face_edges, mesh.half_edges, mesh.edge_class, sharp
    blocks.run(len(sharp), mark_flat_sides.over(*sides, ROWS, is_flat))
    flat = sharp[is_flat]
    left = np.ones(len(flat), dtype=bool)
    met = np.zeros(mesh.vertex_count, dtype=np.int32), np.zeros((mesh.vertex_count, 3))
    drop_loose_ends(points, mesh.edges, flat, at_others(mesh), cosine, *met, left)
    return flat[left]
