"""The crease lines of a level, as ``pns_common.geometry.crease_lines`` finds them."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.creases import mark_edges_beyond
from pns_common.fused.mesh_edges import MeshEdges
from pns_common.geometry.crease_lines import lines_among


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

    def mark(rows: slice) -> None:
        bounds = rows.start, rows.stop
        found[blocks.number(rows, count)] = mark_edges_beyond(*around, *bounds, beyond)

    blocks.run(count, mark)
    sharp = np.flatnonzero(beyond) if found.any() else np.zeros(0, dtype=np.int64)
    return lines_among(points, mesh, sharp, angle)
