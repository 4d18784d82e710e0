"""Faces of a mesh that pass through another face, away from what the two share."""

import numpy as np
from igl.copyleft.cgal import remesh_self_intersections
from jaxtyping import Bool

from pns_common import Mesh

# Heights over a face's plane below this share of the face's size decide nothing.
NEARLY = 1e-9


def crossing_faces(mesh: Mesh) -> Bool[np.ndarray, " F"]:
    """Return which faces an edge of another face passes through, or the reverse.

    CGAL names the pairs that meet, by exact arithmetic. Those of which one lies on one side of the
    other's plane only touch: faces in one plane, and where rounding would decide.
    """
    points, faces = mesh.vertices.copy(), mesh.faces.copy()
    pairs = np.asarray(remesh_self_intersections(points, faces, detect_only=True)[2])
    corners = points[faces]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals, longest = np.cross(u, v), np.sqrt(np.maximum((u * u).sum(1), (v * v).sum(1)))
    slack = NEARLY * np.linalg.norm(normals, axis=1) * longest
    through = np.ones(len(pairs), dtype=bool)
    for plane, other in (pairs.T, pairs[:, ::-1].T):
        height = np.einsum("pck,pk->pc", corners[other] - corners[plane, :1], normals[plane])
        through &= (height.max(axis=1) > slack[plane]) & (height.min(axis=1) < -slack[plane])
    crossing = np.zeros(len(faces), dtype=bool)
    crossing[pairs[through].reshape(-1)] = True
    return crossing
