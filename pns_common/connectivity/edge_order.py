"""The order in which an interior edge's four vertices are read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.topology import Topology


@dataclass(frozen=True, eq=False)
class OrderedEdges:
    """Vertices a, b, c, d of N interior edges, and the faces of c and of d."""

    stencil: Int[np.ndarray, "N 4"]
    faces: Int[np.ndarray, "N 2"]


def first_face_order(topology: Topology, edges: Int[np.ndarray, " N"]) -> OrderedEdges:
    """Take for c the vertex in the face of lower index, for d that in the other."""
    return OrderedEdges(topology.stencil[edges], topology.half_edges[edges] // 3)


def left_face_order(topology: Topology, edges: Int[np.ndarray, " N"]) -> OrderedEdges:
    """Take for c the vertex left of a → b, seen from outside: in the face that runs from a to b."""
    first = first_face_order(topology, edges)
    start = np.take(topology.faces, topology.half_edges[edges, 0])
    right = (start != first.stencil[:, 0])[:, None]
    return OrderedEdges(
        stencil=np.where(right, first.stencil[:, [0, 1, 3, 2]], first.stencil),
        faces=np.where(right, first.faces[:, ::-1], first.faces),
    )
