"""Rows of three numbers in numpy, and the normals of triangles."""

import numpy as np
from jaxtyping import Float, Int

# A face has no area where twice its area is below this share of its squared sides.
NO_AREA = 1e-12


def dot(u: Float[np.ndarray, "*N 3"], v: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
    """Return inner products."""
    return (u * v).sum(axis=-1)


def norm(v: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
    """Return lengths."""
    return np.sqrt(dot(v, v))


def angle(u: Float[np.ndarray, "*N 3"], v: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N"]:
    """Return angles between vectors, radians; 0 where one of them is 0."""
    return np.arctan2(norm(np.cross(u, v)), dot(u, v))


def unit(
    v: Float[np.ndarray, "N 3"], shortest: Float[np.ndarray, " N"] | float = 0.0
) -> Float[np.ndarray, "N 3"]:
    """Scale rows longer than `shortest` to length 1; all others become zero."""
    length = norm(v)
    return v / np.where(length > shortest, length, np.inf)[:, None]


def face_normals(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "F 3"]:
    """Return unit normals of triangles, anticlockwise from outside; 0 without area."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    u, v = b - a, c - a
    return unit(np.cross(u, v), NO_AREA * (dot(u, u) + dot(v, v)))
