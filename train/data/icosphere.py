"""The icosahedron, split and laid onto the unit sphere."""

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.connectivity import connect


def icosphere(splits: int) -> Mesh:
    """Return the icosahedron, split so often and laid onto the unit sphere."""
    golden = (1 + 5**0.5) / 2
    points = [(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(p, k) for k in range(3) for p in points], dtype=float)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = np.triu((apart > 0) & (apart < 2.01))
    faces = np.argwhere(near[:, :, None] & near[:, None, :] & near[None, :, :])
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = (a * np.cross(b, c)).sum(axis=1) < 0
    mesh = Mesh(points, np.where(inward[:, None], faces[:, ::-1], faces))
    for _ in range(splits):
        level = connect(mesh.faces, len(mesh.vertices))
        middles = mesh.vertices[level.edges.numpy()].mean(axis=1)
        on_sphere = _unit(np.concatenate([mesh.vertices, middles]))
        mesh = Mesh(on_sphere, level.split().numpy())
    return Mesh(_unit(mesh.vertices), mesh.faces)


def _unit(points: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "V 3"]:
    return points / np.linalg.norm(points, axis=1, keepdims=True)
