"""Pictures of smooth surfaces with highlights, in which ripples show. No display, no other library.

A fine mesh is drawn as points: so many on each face that none of its pixels stays empty, the
nearest of each pixel kept. Normals are the vertices', linear over each face; light by Blinn and
Phong.
"""

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.metrics.shape import vertex_normals

# Width and height of a picture, pixels.
SIDE = 420

MARGIN = 1.08
LIGHTS = ((-0.5, 0.6, 0.8), (0.9, 0.1, 0.45))
AMBIENT, DIFFUSE, SPECULAR, SHININESS = 0.22, 0.5, 0.55, 60.0
COLOUR = np.array([0.62, 0.68, 0.76])
# The background alone is white.
BRIGHTEST = 0.99

# Points stand so far apart, in pixels.
SPACING = 0.6

MOST_STEPS = 64


def shaded(
    mesh: Mesh, view: Float[np.ndarray, "3 3"], box: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "H W 3"]:
    """Return a picture, 0 … 1, on white; rows of `view` are right, up and towards the viewer.

    `box` is what the picture has room for, so that several results of one mesh are drawn alike.
    """
    centre = box.mean(axis=0)
    scale = SIDE / (MARGIN * float(np.linalg.norm(box[1] - box[0])))
    seen = (mesh.vertices - centre) @ view.T * scale + [SIDE / 2, SIDE / 2, 0]
    normals = vertex_normals(mesh) @ view.T
    points, directions = _points(seen[mesh.faces], normals[mesh.faces])
    column, row = np.floor(points[:, 0]).astype(int), SIDE - 1 - np.floor(points[:, 1]).astype(int)
    inside = (column >= 0) & (column < SIDE) & (row >= 0) & (row < SIDE)
    pixel = (row * SIDE + column)[inside]
    # The nearest point of a pixel comes last, and stays.
    order = np.argsort(points[inside, 2], kind="stable")
    picture = np.ones((SIDE * SIDE, 3))
    picture[pixel[order]] = _lit(directions[inside][order])
    return picture.reshape(SIDE, SIDE, 3)


def camera(azimuth: float, elevation: float, up: int = 2) -> Float[np.ndarray, "3 3"]:
    """Return the view from a direction in degrees; `up` is the axis that points up."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    rows = np.stack([right, np.cross(towards, right), towards])
    return rows if up == 2 else rows[:, [1, 2, 0]]


def _points(
    corners: Float[np.ndarray, "F 3 3"], normals: Float[np.ndarray, "F 3 3"]
) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"]]:
    """Return points on all faces, evenly, with their normals."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / SPACING), 1, MOST_STEPS).astype(int)
    points, directions = [], []
    for count in np.unique(steps):
        i, j = (axis.ravel() for axis in np.mgrid[: count + 1, : count + 1])
        weights = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
        points.append((weights @ corners[steps == count]).reshape(-1, 3))
        directions.append((weights @ normals[steps == count]).reshape(-1, 3))
    return np.concatenate(points), np.concatenate(directions)


def _lit(normals: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 3"]:
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = normals / np.maximum(length, 1e-12)
    # Both sides are lit.
    unit = unit * np.where(unit[:, 2:] < 0, -1.0, 1.0)
    shade, shine = np.full(len(unit), AMBIENT), np.zeros(len(unit))
    for light in LIGHTS:
        towards = np.array(light) / np.linalg.norm(light)
        half = np.add(towards, [0, 0, 1])
        half = half / np.linalg.norm(half)
        shade += DIFFUSE * np.maximum(unit @ towards, 0)
        shine += SPECULAR * np.maximum(unit @ half, 0) ** SHININESS
    return np.clip(shade[:, None] * COLOUR + shine[:, None], 0, BRIGHTEST)
