"""Where groups of faces meet in a plane: the borders of what materials draw on a flat side.

The correction is 0 on planes, and what is left there is Loop's rule, which moves old vertices along
the plane, far where triangles are long. The shape stays as it is, but a rectangle of another colour
becomes an arrow. As creases such borders are curves of their own, and no shape changes by it.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Int

from pns_common.fused.interior_edges import interior_edges
from pns_common.geometry.frames import face_normals
from pns_common.geometry.sharp_edges import turn_by_more

# Faces that turn by no more than this, in radians, lie in one plane: far above what single
# precision does to one, far below what shading shows of an edge.
IN_ONE_PLANE = math.radians(0.1)


def flat_borders(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    group_of_face: Int[np.ndarray, " F"],
) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges, as pairs of vertices, of two faces in a plane of different groups.

    A face without area lies in no plane.
    """
    if len(faces) == 0 or (group_of_face == group_of_face[0]).all():
        return np.zeros((0, 2), dtype=np.int64)
    edges, half_edges = interior_edges(faces, len(points))
    both = half_edges // 3
    rows = np.flatnonzero(group_of_face[both[:, 0]] != group_of_face[both[:, 1]])
    edges, (first, second) = edges[rows], both[rows].T
    beside = np.concatenate([first, second])
    normals = face_normals(points, faces[beside])
    pairs = np.arange(2 * len(rows)).reshape(2, -1).T
    flat = ~turn_by_more(normals, pairs, IN_ONE_PLANE)
    known = normals.any(axis=1)[pairs].all(axis=1)
    return edges[flat & known].astype(np.int64)
