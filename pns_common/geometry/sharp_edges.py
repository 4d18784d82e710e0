"""Interior edges whose two faces turn by more than an angle."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int

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
    edge_faces = topology.edge_faces[topology.interior]
    sharp = turn_by_more(face_normals(points, faces), edge_faces, angle)
    return topology.edges[topology.interior[sharp]]


def turn_by_more(
    normals: Float[np.ndarray, "F 3"], edge_faces: Int[np.ndarray, "I 2"], angle: float
) -> Bool[np.ndarray, " I"]:
    """Return where the unit normals of two faces differ by more than ``angle`` ≥ 0, radians.

    The normal of a face without area is 0, and nothing turns there.
    """
    n1, n2 = (normals[side] for side in edge_faces.T)
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    # The chord of an angle keeps small angles that a cosine would round away.
    chord = n1 - n2
    return defined & (dot(chord, chord) > (2 * math.sin(min(angle, math.pi) / 2)) ** 2)
