"""Dense meshes made coarse in one of several ways: in practice it may have been any of them."""

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh, MeshError
from train.data.dense_meshes import is_manifold
from train.data.simplifiers import SIMPLIFIERS, fast_quadric

# How often each of `train.data.simplifiers`.
#
# The cheapest collapses first leave faces that are longer and thinner, along what bends one way
# only, than sweeps with a threshold do.
WAYS = {"fast-quadric": 0.5, "quadric": 0.3, "shortest-edges": 0.12, "clustered": 0.08}

# How fast the sweeps' threshold may rise.
AGGRESSIVENESS = (3.0, 5.0, 7.0)

FEWEST = 8


def coarsened(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    count: int,
    rng: np.random.Generator,
) -> Mesh | None:
    """Return a mesh of about `count` faces; None where it is no manifold any more."""
    way = str(rng.choice(list(WAYS), p=list(WAYS.values())))
    aggressiveness = float(rng.choice(AGGRESSIVENESS))
    dense = Mesh(points, faces)
    try:
        if way == "fast-quadric":
            mesh = fast_quadric(dense, count, aggressiveness)
        else:
            mesh = SIMPLIFIERS[way](dense, count)
    except MeshError:
        return None
    return mesh if len(mesh.faces) >= FEWEST and is_manifold(mesh) else None
