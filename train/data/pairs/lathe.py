"""Prisms, cones and turned parts, one row of faces to each straight piece of their outline.

Modellers draw a wall with one quad from rim to rim however long it is, and a tip as one fan. Long
thin faces between a sharp rim and gentle bends come from nowhere else. With many sides the part
stands for what turns round, with few for the polyhedron itself; but a pyramid of few sides, which
says too little of any surface, for what quasi-interpolation makes of it.
"""

import numpy as np
import torch
from jaxtyping import Float

from pns_common import Mesh, loop
from train.connectivity import connect
from train.data.pairs.faceted import sampled
from train.data.pairs.references import LATHE, Pair
from train.refining import refine
from train.surfaces.quasi_interpolation import normal_push
from train.surfaces.solids import random_rotation

FEWEST_SIDES, MOST_SIDES = 3, 40
# How often the sides are few; sides from which on the part stands for a round one.
FEW, ROUND = 0.25, 7

# Sides, at least, of the mesh that stands for a round part.
FINE = 180

FINE_LEVELS = 4

# Straight pieces of the outline, and how often.
PIECES = {1: 0.5, 2: 0.2, 3: 0.2, 4: 0.1}

# How often a piece has more than one row, up to five.
SEVERAL_ROWS = 0.25

# How often an end is a tip; and how often a flat one has a vertex in its middle.
TIP, CENTRE = 0.35, 0.5

Outline = Float[np.ndarray, "N 2"]


def lathe_pair(rng: np.random.Generator) -> Pair:
    """Return a part turned on a lathe, as few faces, turned at random."""
    few = rng.random() < FEW
    sides = int(rng.integers(FEWEST_SIDES, ROUND) if few else rng.integers(ROUND, MOST_SIDES + 1))
    outline, tips = _outline(rng)
    centres = tips | (rng.random(2) < CENTRE)
    coarse = turned(outline, sides, centres)
    fine = coarse
    if sides >= ROUND:
        fine = turned(outline, sides * -(-FINE // sides), np.array([True, True]))
    elif tips.any():
        points, level = torch.tensor(coarse.vertices), connect(coarse.faces, len(coarse.vertices))
        pushed = Mesh((points + normal_push(points, level)).numpy(), coarse.faces)
        fine = refine(pushed, loop(), FINE_LEVELS).mesh
    turn = random_rotation(rng)
    surface = sampled(fine.vertices @ turn, fine.faces, rng)
    return Pair(LATHE, Mesh(coarse.vertices @ turn, coarse.faces), surface)


def turned(outline: Outline, sides: int, centres: np.ndarray) -> Mesh:
    """Return the surface of an outline that turns round the z axis; outwards where it rises.

    Args:
        outline: radius and height of each ring; radius 0 at an end is a tip.
        centres: of either end, whether its fan has a vertex in the middle; a tip has.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    tips = outline[[0, -1], 0] == 0
    rings = outline[int(tips[0]) : len(outline) - int(tips[1])]
    points = [np.c_[r * np.cos(angle), r * np.sin(angle), 0 * angle + z] for r, z in rings]
    j, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for row in range(len(rings) - 1):
        low, high = row * sides, (row + 1) * sides
        faces += [np.c_[low + j, low + after, high + after], np.c_[low + j, high + after, high + j]]
    ends = ((0, after, j, outline[0, 1]), ((len(rings) - 1) * sides, j, after, outline[-1, 1]))
    for (start, first, second, height), centre in zip(ends, centres, strict=True):
        if centre:
            middle = len(rings) * sides + len(points) - len(rings)
            points.append(np.array([[0.0, 0.0, height]]))
            faces.append(np.c_[start + first, start + second, np.full(sides, middle)])
        else:
            fan = np.stack([0 * first, first, second], axis=1)[1:-1] + start
            faces.append(fan)
    return Mesh(np.concatenate(points), np.concatenate(faces))


def _outline(rng: np.random.Generator) -> tuple[Outline, np.ndarray]:
    """Return rings from below to above, and which ends are tips; at least one is none."""
    pieces = int(rng.choice(list(PIECES), p=list(PIECES.values())))
    radius = np.exp(rng.uniform(-0.7, 0.4, pieces + 1))
    if rng.random() < 0.5:
        radius[:] = radius[0]
    steps = np.exp(rng.uniform(-2.0, 1.2, pieces))
    height = np.concatenate([[0.0], np.cumsum(steps)])
    tips = rng.random(2) < TIP
    if pieces == 1 and tips.all():
        tips[0] = False
    radius[[0, -1]] = np.where(tips, 0.0, radius[[0, -1]])
    rings = [np.array([[radius[0], height[0]]])]
    for k in range(pieces):
        ends_in_tip = radius[k] == 0 or radius[k + 1] == 0
        many = rng.random() < SEVERAL_ROWS and not ends_in_tip
        rows = int(rng.integers(2, 6)) if many else 1
        share = np.linspace(0, 1, rows + 1)[1:, None]
        ends = np.array([[radius[k], height[k]], [radius[k + 1], height[k + 1]]])
        rings.append(ends[:1] * (1 - share) + ends[1:] * share)
    return np.concatenate(rings), tips
