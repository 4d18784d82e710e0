"""Primitives for the tests, as `files.document` takes them."""

import numpy as np


def octahedron(**others):
    """A closed surface of 8 faces and 6 vertices, without any other attribute."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    return {"POSITION": points.astype(float), "indices": np.array(faces), **others}


def box(**others):
    """A cube with hard edges: 24 vertices, 12 faces, normals, tangents and UVs by side."""
    points, normals, tangents, uvs, faces = [], [], [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u = np.roll(normal, 1) * sign
            v = np.cross(normal, u)
            start = len(points)
            for s, t in [(-1, -1), (1, -1), (1, 1), (-1, 1)]:
                points.append(normal + s * u + t * v)
                normals.append(normal)
                tangents.append([*u, 1.0])
                uvs.append([(s + 1) / 2, (t + 1) / 2])
            faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    return {
        "POSITION": np.array(points),
        "NORMAL": np.array(normals),
        "TANGENT": np.array(tangents),
        "TEXCOORD_0": np.array(uvs),
        "indices": np.array(faces).astype(np.uint16),
        **others,
    }
