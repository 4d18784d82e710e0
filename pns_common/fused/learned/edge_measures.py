"""What a level's edges are like, measured once for its rings and for what they see themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.features.edge_features import SHORTEST
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.edge_measures import HELD, measure_edges
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.fused.levels.mesh_edges import MeshEdges


@dataclass(frozen=True, eq=False)
class EdgeMeasures:
    """Of each edge of a level.

    Attributes:
        lengths: h.
        network_lengths: ℓ.
        jumps: x, 0 where it is not interior; none once forgotten.
        bends: s, likewise.
    """

    lengths: Float[np.ndarray, " E"]
    network_lengths: Float[np.ndarray, " E"]
    jumps: Float[np.ndarray, " J"]
    bends: Float[np.ndarray, " B"]

    def without_jumps(self) -> EdgeMeasures:
        """Return the same once nobody asks for x."""
        return replace(self, jumps=self.jumps[:0].copy())

    def without_bends(self) -> EdgeMeasures:
        """Return the same once nobody asks for s."""
        return replace(self, bends=self.bends[:0].copy())


def edge_measures(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    at_faces: FaceMeasures,
    altitudes: float,
    blocks: Blocks,
) -> EdgeMeasures:
    """Measure the edges of a level; ``altitudes`` is α of the network's lengths."""
    made = EdgeMeasures(*(np.empty(len(mesh.edges)) for _ in range(4)))
    around = points, at_faces.normals, at_faces.areas, mesh.starts
    of_edges = mesh.edges, mesh.half_edges, mesh.edge_class, altitudes
    to = made.lengths, made.network_lengths, made.jumps, made.bends
    measure = measure_edges.over(*around, *of_edges, ROWS, *to)
    blocks.run(len(mesh.edges), lambda rows: measure(rows, np.empty(HELD * TOGETHER)))
    return made


def log_lengths(lengths: Float[np.ndarray, " E"], blocks: Blocks) -> Float[np.ndarray, " E"]:
    """Return log h, which features are differences of; without length that of SHORTEST."""
    logs = np.empty_like(lengths)

    def take(rows: slice) -> None:
        # numpy's logarithm runs on vectors, and has the array kernels' bits.
        np.log(np.maximum(lengths[rows], SHORTEST, out=logs[rows]), out=logs[rows])

    blocks.run(len(logs), take)
    return logs
