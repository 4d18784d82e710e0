"""Coarse patches on the surfaces of `train.surfaces.cad`: jittered grids, looked at from outside.

The grid spans [−1, 1]² across the line of sight, as the paper's patches do, and is moved along it
onto the surface.
"""

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.data.datasets import Dataset, Instance, grid_faces, jittered_grid
from train.surfaces.cad import RoundedBox, Torus
from train.surfaces.implicit import Surface

JITTER = 0.04
START = 4.0
MARCHES = 400


def tori() -> Dataset:
    """Return four tori seen at their outer equator, tube radius 0.3 … 0.6."""
    tubes = np.linspace(1.2, 1.8, 4)
    return Dataset(
        "cad-torus",
        tuple(
            _instance(Torus(1.5, t), np.array([1.5, 0, 0]), np.array([1.0, 0, 0]), seed)
            for seed, t in enumerate(tubes)
        ),
    )


def rounded_boxes() -> Dataset:
    """Return four box corners with their edges, radius 0.15 … 0.45."""
    centre, sight = np.zeros(3), np.array([1.0, 1, 1])
    radii = np.linspace(0.15, 0.45, 4)
    return Dataset(
        "cad-rounded-box",
        tuple(_instance(RoundedBox(r), centre, sight, seed) for seed, r in enumerate(radii)),
    )


def patch(
    surface: Surface,
    centre: Float[np.ndarray, " 3"],
    sight: Float[np.ndarray, " 3"],
    seed: int,
) -> Mesh:
    """Return a 9 × 9 patch: a grid round `centre`, across `sight`, marched onto the surface."""
    plane = jittered_grid(seed, JITTER).double().numpy()
    return Mesh(marched(surface, plane, centre, sight), grid_faces())


def marched(
    surface: Surface,
    plane: Float[np.ndarray, "P 2"],
    centre: Float[np.ndarray, " 3"],
    sight: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "P 3"]:
    """Return points of the plane across `sight` round `centre`, moved along it onto the surface.

    `surface.value` must be a distance: each march goes as far as is surely free.
    """
    w = sight / np.linalg.norm(sight)
    seed_axis = np.eye(3)[np.abs(w).argmin()]
    u = np.cross(seed_axis, w)
    u /= np.linalg.norm(u)
    v = np.cross(w, u)
    points = centre + plane[:, :1] * u + plane[:, 1:] * v + START * w
    for _ in range(MARCHES):
        points = points - surface.value(points)[:, None] * w
    return points


def _instance(surface: Surface, centre: np.ndarray, sight: np.ndarray, seed: int) -> Instance:
    return Instance(surface, patch(surface, centre, sight, seed))
