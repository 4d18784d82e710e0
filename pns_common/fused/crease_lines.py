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
    points: Float[np.ndarray, "V 3"], mesh: MeshEdges, angle: float, blocks: Blocks
) -> Int[np.ndarray, " N"]:
    """Return the edges of the crease lines; ``angle`` is θ in degrees."""
    cosine, count = math.cos(math.radians(angle)), len(mesh.edges)
    beyond, found = np.zeros(count, dtype=bool), np.zeros(blocks.count(count), dtype=np.int64)
    of_mesh = mesh.faces, mesh.half_edges, mesh.edge_class

    def mark(rows: slice) -> None:
        bounds = rows.start, rows.stop
        found[blocks.number(rows, count)] = mark_edges_beyond(
            points, *of_mesh, cosine, *bounds, beyond
        )

    blocks.run(count, mark)
    sharp = np.flatnonzero(beyond) if found.any() else np.zeros(0, dtype=np.int64)
    return lines_among(points, mesh, sharp, angle)
