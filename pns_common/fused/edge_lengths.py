"""Lengths of a level's edges, and the logarithms that features are differences of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.features.edge_features import SHORTEST
from pns_common.fused.kernels.edge_lengths import measure_lengths
from pns_common.fused.mesh_edges import MeshEdges


@dataclass(frozen=True, eq=False)
class EdgeLengths:
    """h of each edge, and log h; of an edge without length the logarithm of SHORTEST."""

    lengths: Float[np.ndarray, " E"]
    logs: Float[np.ndarray, " E"]


def edge_lengths(points: Float[np.ndarray, "V 3"], mesh: MeshEdges, blocks: Blocks) -> EdgeLengths:
    """Measure the edges of a level."""
    count = len(mesh.edges)
    lengths, logs = np.empty(count), np.empty(count)

    def measure(rows: slice) -> None:
        measure_lengths(points, mesh.edges, rows.start, rows.stop, lengths)
        # numpy's logarithm runs on vectors, and has the array kernels' bits.
        np.log(np.maximum(lengths[rows], SHORTEST), out=logs[rows])

    blocks.run(count, measure)
    return EdgeLengths(lengths, logs)
