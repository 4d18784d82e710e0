"""Spheres and ellipsoids of 8 to 2,500 faces: from h ≈ 1.5 R down to h ≈ 0.05 R."""

import numpy as np

from pns_common import Mesh
from train.data.pairs.coarsened import coarsened
from train.data.pairs.references import Pair, Reference
from train.data.primitives import icosphere

# How often it is an icosphere; and collapsed with its vertices laid back onto the surface.
ICOSPHERE, ON_SURFACE = 0.4, 0.3

DENSE_SPLITS, MOST_SPLITS = 5, 3
FEWEST, MOST = 12, 2500
ROUND = 0.5


def sphere_pair(rng: np.random.Generator) -> Pair | None:
    """Return a coarse mesh of a sphere, or of an ellipsoid; None where collapses spoilt it."""
    dense = icosphere(DENSE_SPLITS)
    axes = np.ones(3) if rng.random() < ROUND else 1 + rng.uniform(-0.4, 0.4, 3)
    kind = rng.random()
    if kind < ICOSPHERE:
        coarse = icosphere(int(rng.integers(0, MOST_SPLITS + 1)))
        coarse = Mesh(coarse.vertices * axes, coarse.faces)
    else:
        count = int(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST))))
        coarse = coarsened(dense.vertices * axes, dense.faces, count, rng)
        if coarse is not None and kind < ICOSPHERE + ON_SURFACE:
            unit = coarse.vertices / axes
            unit /= np.linalg.norm(unit, axis=1, keepdims=True)
            coarse = Mesh(unit * axes, coarse.faces)
    if coarse is None:
        return None
    normals = dense.vertices / axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Pair("sphere", coarse, Reference(dense.vertices * axes, normals))
