"""Faces that lie on each other: with the three vertices of another face, or one of them twice.

What they are split into has edges that no other split makes: those between the middles of their
sides, where all their children meet. So the middle of such a side is not regular as others are.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.topology import EdgeClass, Topology
from pns_common.mesh import repeated_vertex


def irregular_in_split(topology: Topology) -> Int[np.ndarray, " N"]:
    """Return the vertices of a mesh's split whose rings follow from no ring or edge of the mesh.

    These are the middles of such faces' sides, and the corners of those with a vertex twice.
    """
    # Two faces on one edge lie on each other where both have one vertex opposite; where more do,
    # or faces of less than three vertices, no edge of theirs is interior.
    opposite = topology.stencil[:, 2:]
    could = topology.edge_class == int(EdgeClass.IRREGULAR)
    could |= (opposite[:, 0] == opposite[:, 1]) & (opposite[:, 0] >= 0)
    if not could.any():
        return np.zeros(0, dtype=np.int64)
    rows = np.flatnonzero(could[topology.face_edges].all(axis=1))
    faces = topology.faces[rows]
    collapsed = repeated_vertex(faces)
    _, alike, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    doubled = rows[collapsed | (count[alike.reshape(-1)] > 1)]
    middles = topology.vertex_count + topology.face_edges[doubled]
    return np.unique(np.concatenate([middles.reshape(-1), faces[collapsed].reshape(-1)]))
