"""Turned parts drawn with few faces, and what an artist expects of them.

Barrels, bottles, cakes of discs, limbs with round ends, cones, wheels, prisms. Corners of the
outline, and of the polygon that turns, stand for a smooth curve through them where they turn by
less than `CRISP`, and are meant as they are where they turn by more: so eight sides are round and
six are a hexagon, and rims stay crisp. One row of faces to each piece: long thin faces between a
sharp rim and gentle bends come from nowhere else.
"""

import numpy as np
from jaxtyping import Bool, Float

from pns_common import Mesh
from train.data.pairs.faceted import sampled
from train.data.pairs.references import Pair, sharp_edges
from train.surfaces.solids import random_rotation

# Corners that turn by more are meant, radians.
CRISP = np.radians(48)

# Sides: from which on the part is round; how often they are fewer; of the mesh that stands for it.
ROUND, FEW, FINE = 8, 0.2, 180
FEWEST_SIDES, MOST_SIDES = 3, 36

# Points of the fine outline to each piece that is no straight line.
CURVED = 10

# Edges of the fine mesh that turn by more are sharp, radians.
FINE_SHARP = np.radians(20)

# How often an end is a tip; and how often a flat one has a vertex in its middle.
TIP, CENTRE = 0.3, 0.5

Outline = Float[np.ndarray, "N 2"]


def lathe_pair(rng: np.random.Generator) -> Pair:
    """Return a turned part as few faces, turned at random in space."""
    few = rng.random() < FEW
    sides = int(rng.integers(FEWEST_SIDES, ROUND) if few else rng.integers(ROUND, MOST_SIDES + 1))
    kind = OUTLINES[int(rng.integers(len(OUTLINES)))]
    outline, closed = kind(rng), kind is _wheel
    coarse = turned(outline, sides, rng.random(2) < CENTRE, closed=closed)
    smooth = _smoothed(outline, closed=closed)
    many = sides if few else sides * -(-FINE // sides)
    fine = turned(smooth, many, np.array([True, True]), closed=closed)
    turn = random_rotation(rng)
    surface = sampled(fine.vertices @ turn, fine.faces, rng)
    sharp = sharp_edges(fine, FINE_SHARP) @ turn
    return Pair("lathe", Mesh(coarse.vertices @ turn, coarse.faces), surface, sharp)


def turned(
    outline: Outline, sides: int, centres: Bool[np.ndarray, " 2"], *, closed: bool = False
) -> Mesh:
    """Return the surface of an outline that turns round the z axis; outwards where it rises.

    Args:
        outline: radius and height of each ring; radius 0 at an end is a tip.
        centres: of either end, whether its fan has a vertex in the middle; a tip has.
        closed: whether the last ring is joined to the first, and no end has a fan.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    tips = outline[[0, -1], 0] == 0
    rings = outline[int(tips[0]) : len(outline) - int(tips[1])]
    points = [np.c_[r * np.cos(angle), r * np.sin(angle), 0 * angle + z] for r, z in rings]
    j, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for row in range(len(rings) - 1 + closed):
        low, high = row * sides, (row + 1) % len(rings) * sides
        faces += [np.c_[low + j, low + after, high + after], np.c_[low + j, high + after, high + j]]
    ends = ((0, after, j, outline[0, 1]), ((len(rings) - 1) * sides, j, after, outline[-1, 1]))
    for (start, first, second, height), centre in zip(ends, centres | tips, strict=True):
        if closed:
            break
        if centre:
            middle = len(rings) * sides + len(points) - len(rings)
            points.append(np.array([[0.0, 0.0, height]]))
            faces.append(np.c_[start + first, start + second, np.full(sides, middle)])
        else:
            fan = np.stack([0 * first, first, second], axis=1)[1:-1] + start
            faces.append(fan)
    return Mesh(np.concatenate(points), np.concatenate(faces))


def _smoothed(outline: Outline, *, closed: bool) -> Outline:
    """Return the curve through an outline, with corners where it turns by more than `CRISP`.

    Cubic pieces (Catmull and Rom 1974), parabolas beside a corner, straight between two of them.
    """
    if closed:
        before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    else:
        # Beyond a tip the outline goes on on the axis's other side, beyond a flat end on the axis.
        beyond = [
            np.where(end[0] == 0, inner * [-1, 1], end * [0, 1])
            for end, inner in ((outline[0], outline[1]), (outline[-1], outline[-2]))
        ]
        before = np.concatenate([[beyond[0]], outline[:-1]])
        after = np.concatenate([outline[1:], [beyond[1]]])
    came, goes = outline - before, after - outline
    cross = came[:, 0] * goes[:, 1] - came[:, 1] * goes[:, 0]
    smooth = np.abs(np.arctan2(cross, (came * goes).sum(axis=1))) < CRISP
    a, b = np.linalg.norm(came, axis=1)[:, None], np.linalg.norm(goes, axis=1)[:, None]
    tangent = (came / a * b + goes / b * a) / (a + b)
    curve: list[np.ndarray] = []
    for k in range(len(outline) - 1 + closed):
        n = (k + 1) % len(outline)
        chord, length = goes[k], b[k]
        start, end = tangent[k] * length, tangent[n] * length
        start = start if smooth[k] else (2 * chord - end if smooth[n] else chord)
        end = end if smooth[n] else 2 * chord - start
        share = np.linspace(0, 1, CURVED if smooth[k] or smooth[n] else 1, endpoint=False)[:, None]
        ease = share**2 * (3 - 2 * share)
        curve.append(
            outline[k]
            + ease * chord
            + share * (1 - share) ** 2 * start
            - share**2 * (1 - share) * end
        )
    made = np.concatenate(curve if closed else [*curve, outline[-1:]])
    made[:, 0] = np.maximum(made[:, 0], 0)
    return made


def _pieces(rng: np.random.Generator) -> Outline:
    """Return a few straight pieces of any proportions: cones, prisms, funnels."""
    count = int(rng.integers(1, 5))
    radius = np.exp(rng.uniform(-0.7, 0.4, count + 1))
    if rng.random() < 0.5:
        radius[:] = radius[0]
    height = np.append(0.0, np.cumsum(np.exp(rng.uniform(-2.0, 1.2, count))))
    tips = rng.random(2) < TIP
    tips[0] &= count > 1 or not tips[1]
    radius[[0, -1]] = np.where(tips, 0.0, radius[[0, -1]])
    return np.stack([radius, height], axis=1)


def _barrel(rng: np.random.Generator) -> Outline:
    """Return a bulge between two flat ends, with hoops on it now and then."""
    height, bulge = rng.uniform(0.8, 3), rng.uniform(0.05, 0.35)
    share = np.linspace(-1, 1, int(rng.integers(3, 8)))
    outline = np.stack([1 - bulge * share**2, share * height / 2], axis=1)
    if rng.random() < 0.4:
        at, thick = outline[len(outline) // 2 - 1 : len(outline) // 2 + 1], rng.uniform(0.03, 0.1)
        outline = np.concatenate(
            [
                outline[: len(outline) // 2],
                at + np.array([thick, 0]),
                outline[len(outline) // 2 :],
            ]
        )
    return outline


def _cake(rng: np.random.Generator) -> Outline:
    """Return discs on one another, each narrower or wider than the one below."""
    count = int(rng.integers(1, 5))
    height = np.append(0.0, np.cumsum(rng.uniform(0.1, 0.6, count)))
    radius = np.exp(rng.uniform(-0.7, 0.3, count))
    if rng.random() < 0.6:
        radius = np.sort(radius)[::-1]
    return np.stack([np.repeat(radius, 2), np.repeat(height, 2)[1:-1]], axis=1)


def _limb(rng: np.random.Generator) -> Outline:
    """Return a capsule, or half of one, of two radii."""
    rows, length = int(rng.integers(2, 5)), rng.uniform(0.2, 3)
    low, high = rng.uniform(0.3, 0.8, 2)
    angle = np.linspace(0, np.pi / 2, rows + 1)
    bottom = low * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    top = high * np.stack([np.cos(angle), np.sin(angle)], axis=1) + [0, length]
    return np.concatenate([bottom if rng.random() < 0.7 else bottom[-1:], top])


def _bottle(rng: np.random.Generator) -> Outline:
    """Return a body, a shoulder and a neck."""
    body, neck = rng.uniform(0.5, 1), rng.uniform(0.12, 0.4)
    height = np.cumsum(rng.uniform([0.6, 0.1, 0.1, 0.1, 0.2], [2, 0.3, 0.3, 0.3, 0.8]))
    radius = [body, body, 0.9 * body, (body + neck) / 2, neck, neck]
    outline = np.stack([radius, np.append(0.0, height)], axis=1)
    lip = np.array([[neck * 1.3, height[-1]], [neck * 1.3, height[-1] + 0.1]])
    return np.concatenate([outline, lip]) if rng.random() < 0.5 else outline


def _wheel(rng: np.random.Generator) -> Outline:
    """Return the closed outline of a ring: a tyre, a rim or a tube."""
    count, radius = int(rng.integers(4, 13)), rng.uniform(0.15, 0.6)
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    section = radius * np.stack([np.cos(angle), np.sin(angle) * rng.uniform(0.5, 1.5)], axis=1)
    if rng.random() < 0.3:
        section = np.clip(section, -0.8 * radius, 0.8 * radius)
    return section + np.array([1.0, 0.0])


OUTLINES = (_pieces, _pieces, _barrel, _cake, _limb, _bottle, _wheel)
