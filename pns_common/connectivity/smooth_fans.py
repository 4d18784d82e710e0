"""The smooth fans of a mesh's corners: faces around a vertex that follow one another across edges.

Creases, boundaries and irregular edges part them; the corners of a fan can share a normal.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.distinct import number_by_first_appearance
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology, next_corner


def smooth_fans(
    faces: Int[np.ndarray, "F 3"], vertex_count: int, creases: Int[np.ndarray, "N 2"] | None
) -> Int[np.ndarray, "F 3"]:
    """Return the fan of each corner, numbered as they first appear."""
    topology = with_creases(build_topology(faces, vertex_count), creases)
    there, back = topology.half_edges[topology.interior].T
    # Both ends of an edge join the corners of its two faces.
    corners = np.concatenate([there, next_corner(there)])
    facing = np.concatenate([next_corner(back), back])
    label = np.arange(faces.size)
    while True:
        least = np.minimum(label[corners], label[facing])
        new = label.copy()
        np.minimum.at(new, corners, least)
        np.minimum.at(new, facing, least)
        # A label names a corner of the same fan, whose own label may be less by now.
        new = new[new]
        if np.array_equal(new, label):
            break
        label = new
    return number_by_first_appearance(label)[0].reshape(-1, 3)
