"""Some edges of a mesh by themselves, for rules that look at vertices and edges alone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import EdgeClass, Topology


def edges_alone(
    edges: Int[np.ndarray, "E 2"], edge_class: Int[np.ndarray, " E"], vertex_count: int
) -> tuple[Int[np.ndarray, " N"], Topology]:
    """Return the vertices of some edges, ascending, and a topology of these without faces."""
    used = marked(edges.reshape(-1), vertex_count)
    vertices, own = np.flatnonzero(used), (np.cumsum(used) - 1)[edges]
    no_faces, nothing = np.zeros((0, 3), dtype=np.int64), np.full((len(edges), 2), -1)
    return vertices, Topology(
        vertex_count=len(vertices),
        faces=no_faces,
        edges=own,
        face_edges=no_faces,
        half_edges=nothing,
        stencil=np.concatenate([own, nothing], axis=1),
        edge_class=edge_class,
        # Compared in 64 bits an enumeration's members take seven times as long.
        interior=np.flatnonzero(edge_class == int(EdgeClass.INTERIOR)),
    )
