"""Where groups of faces meet inside a plane: the borders of what materials draw on a flat side.

The correction is 0 on planes, and what is left there is Loop's rule, which moves old vertices along
the plane, far where triangles are long. The shape stays as it is, but a rectangle of another colour
becomes an arrow. As creases such borders are curves of their own.

Those that reach a rim of the plane end before it: a crease more makes a corner of a vertex on a
rim, and a round one would have dents. So no vertex leaves its plane by this, nor a rim its curve.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import dot, marked
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.geometry.crease_lines.turns import IN_ONE_PLANE
from pns_common.geometry.frames import face_normals


def flat_borders(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    group_of_face: Int[np.ndarray, " F"],
) -> Int[np.ndarray, "N 2"]:
    """Return the edges, as pairs of vertices, of faces of different groups inside of planes.

    Around both ends all lies in one plane.
    """
    if len(faces) == 0 or (group_of_face == group_of_face[0]).all():
        return np.zeros((0, 2), dtype=np.int64)
    edges, half_edges = interior_edges(faces, len(points))
    both = half_edges // 3
    is_border = group_of_face[both[:, 0]] != group_of_face[both[:, 1]]
    inside = _inside_planes(points, faces, edges, edges[is_border].reshape(-1))
    return edges[is_border & inside[edges].all(axis=1)].astype(np.int64)


def _inside_planes(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    edges: Int[np.ndarray, "I 2"],
    asked: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " V"]:
    """Return which of the vertices that are asked for have one plane around them.

    ``edges`` are the interior ones. Faces without area, which fill in where a vertex lies on a
    longer edge, are in every plane.
    """
    count = len(points)
    inside = marked(asked, count)
    edges, near = edges[inside[edges].any(axis=1)], faces[inside[faces].any(axis=1)]
    # Where all edges are interior there are as many as faces.
    ends, corners = (np.bincount(each.reshape(-1), minlength=count) for each in (edges, near))
    inside &= ends == corners
    normals = face_normals(points, near)
    known = normals.any(axis=1)
    corner, normal = near[known].reshape(-1), np.repeat(normals[known], 3, axis=0)
    of_vertex = np.zeros((count, 3))
    of_vertex[corner] = normal
    inside &= of_vertex.any(axis=1)
    chord = normal - of_vertex[corner]
    inside[corner[dot(chord, chord) > math.radians(IN_ONE_PLANE) ** 2]] = False
    return inside
