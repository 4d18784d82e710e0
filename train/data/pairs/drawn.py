"""Bodies of revolution drawn with few sides: cones, spindles, drums, and what lies between.

From `ROUND` sides on they stand for the round body through their corners, whose tips and rims are
sharp; with fewer sides they are meant as they are.
"""

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.data.pairs.faceted import sampled
from train.data.pairs.lathe import FINE, ROUND, centred, polygon, raised, random_lid
from train.data.pairs.references import Pair
from train.surfaces.solids import random_rotation

FEWEST_SIDES, MOST_SIDES = 3, 33

# Radius of the smaller end of a drum, and heights, in radii.
NARROW, HEIGHTS = 0.3, (0.3, 3.0)


def drawn_pair(rng: np.random.Generator) -> Pair:
    """Return a cone, a spindle or a drum, turned at random in space."""
    sides = int(np.exp(rng.uniform(*np.log((FEWEST_SIDES, MOST_SIDES)))))
    outline = OUTLINES[int(rng.integers(len(OUTLINES)))](rng)
    plan = polygon(sides)
    coarse = raised(outline, plan, (random_lid(plan, rng), random_lid(plan, rng)))
    if sides < ROUND:
        fine = coarse
    else:
        # Corners of the coarse mesh are corners of the fine one.
        count = sides * -(-FINE // sides)
        fine = raised(outline, polygon(count), (centred(count), centred(count)))
    turn = random_rotation(rng)
    surface = sampled(fine.vertices @ turn, fine.faces, rng)
    return Pair("drawn", Mesh(coarse.vertices @ turn, coarse.faces), surface)


def _height(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(HEIGHTS))))


def _cone(rng: np.random.Generator) -> Float[np.ndarray, "2 2"]:
    return np.array([[1.0, 0.0], [0.0, _height(rng)]])


def _spindle(rng: np.random.Generator) -> Float[np.ndarray, "3 2"]:
    return np.array([[0.0, -_height(rng)], [1.0, 0.0], [0.0, _height(rng)]])


def _drum(rng: np.random.Generator) -> Float[np.ndarray, "2 2"]:
    top = 1.0 if rng.random() < 1 / 2 else rng.uniform(NARROW, 1)
    return np.array([[1.0, 0.0], [top, _height(rng)]])


OUTLINES = (_cone, _spindle, _drum)
