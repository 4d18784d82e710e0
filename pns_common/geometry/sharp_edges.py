"""Interior edges whose two faces turn by more than an angle."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import dot
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.frames import face_normals


def edges_sharper_than(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], angle: float
) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose faces' normals differ by more than ``angle`` ≥ 0, radians.

    They are pairs of vertices, the lower first. Faces without area have no normal, and none of
    their edges is sharp.
    """
    topology = build_topology(faces, len(points))
    normals = face_normals(points, faces)
    n1, n2 = (normals[side] for side in topology.edge_faces[topology.interior].T)
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    # The chord of an angle keeps small angles that a cosine would round away.
    chord = n1 - n2
    sharp = defined & (dot(chord, chord) > (2 * math.sin(min(angle, math.pi) / 2)) ** 2)
    return topology.edges[topology.interior[sharp]]
