"""Bodies of revolution drawn with few sides: cones, spindles, drums, and what lies between.

From `ROUND` sides on they stand for the round body through their corners, whose tips and rims are
sharp; with fewer sides they are meant as they are.
"""

import numpy as np
from jaxtyping import Float

from train.data.pairs.faceted import sampled
from train.data.pairs.lathe import FINE, FINE_SHARP, ROUND, Plan, centred, raised, random_lid
from train.data.pairs.references import Pair, sharp_edges
from train.surfaces.solids import random_rotation

FEWEST_SIDES, MOST_SIDES = 3, 33

# Radius of the smaller end of a drum, and heights, in radii.
NARROW, HEIGHTS = 0.3, (0.3, 3.0)


def drawn_pair(rng: np.random.Generator) -> Pair:
    """Return a cone, a spindle or a drum, turned at random in space."""
    sides = int(np.exp(rng.uniform(*np.log((FEWEST_SIDES, MOST_SIDES)))))
    outline = OUTLINES[int(rng.integers(len(OUTLINES)))](rng)
    plan = circle(sides)
    coarse = raised(outline, plan, (random_lid(plan, rng), random_lid(plan, rng)))
    if sides < ROUND:
        fine = coarse
    else:
        # Corners of the coarse mesh are corners of the fine one.
        count = sides * -(-FINE // sides)
        fine = raised(outline, circle(count), (centred(count), centred(count)))
    turn = random_rotation(rng)
    surface = sampled(fine.vertices @ turn, fine.faces, rng)
    turned = type(coarse)(coarse.vertices @ turn, coarse.faces)
    whole = type(fine)(fine.vertices @ turn, fine.faces)
    return Pair("drawn", turned, surface, sharp_edges(whole, FINE_SHARP))


def circle(sides: int) -> Plan:
    """Return the corners of a regular polygon, anticlockwise."""
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.c_[np.cos(angle), np.sin(angle)]


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
