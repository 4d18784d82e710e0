"""Which points are a vertex's neighbours: those of its own mesh, or of the mesh it is split into.

The split keeps every ring in its order: where edge e led, the vertex of e now lies. So the limit at
old vertices needs the connectivity of the coarse mesh alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.topology import Topology


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Rows of a point array that are neighbours of a mesh's vertices.

    Attributes:
        topology: of the mesh.
        of_spokes: at the far end of spokes 2 e and 2 e + 1, which start at both ends of edge e.
        leaving: after corner 3 f + i in its face.
        arriving: before it.
    """

    topology: Topology
    of_spokes: Int[np.ndarray, " S"]
    leaving: Int[np.ndarray, " C"]
    arriving: Int[np.ndarray, " C"]


def own_neighbours(topology: Topology) -> Neighbours:
    """Return the neighbours in the mesh itself."""
    return Neighbours(
        topology=topology,
        of_spokes=topology.edges[:, ::-1].reshape(-1),
        leaving=topology.faces[:, [1, 2, 0]].reshape(-1),
        arriving=topology.faces[:, [2, 0, 1]].reshape(-1),
    )


def split_neighbours(topology: Topology) -> Neighbours:
    """Return the same vertices' neighbours in the split mesh: the vertices of their edges."""
    middles = topology.vertex_count + topology.face_edges
    return Neighbours(
        topology=topology,
        of_spokes=np.repeat(topology.vertex_count + np.arange(len(topology.edges)), 2),
        leaving=middles.reshape(-1),
        arriving=middles[:, [2, 0, 1]].reshape(-1),
    )
