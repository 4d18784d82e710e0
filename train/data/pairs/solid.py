"""Random solids, simplified: coarse meshes as they come out of quadric edge collapses."""

from collections.abc import Iterator

import numpy as np

from pns_common import MeshError
from train.data.pairs.references import Coarsen, Pair, Reference, coarsened
from train.data.remeshers import with_points
from train.surfaces.marching import laid_onto, marched, unit_gradient
from train.surfaces.solids import Field, random_solid

# Grid on which a solid is first looked for.
FIRST_LOOK, FIRST_EXTENT = 20, 1.9

MARGIN = 1.12
# Points a side of the grid that it is marched on, and how often.
SIDES = {40: 0.3, 64: 0.7}

FEWEST_DENSE = 500
FEWEST, MOST = 24, 4000
LEAST_REDUCTION = 4
# Half of the coarse meshes are of usual size; the others of any, evenly by logarithm.
USUAL, USUALLY = (300, 2000), 0.5

# How often the collapsed vertices are laid onto the surface; collapses leave them beside it.
ON_SURFACE = 0.16

# Coarse meshes made of one solid.
EACH = 5


def solid_pairs(rng: np.random.Generator, coarsen: Coarsen = coarsened) -> Iterator[Pair]:
    """Yield up to five coarse meshes of one random solid, closed manifolds all."""
    field = _framed(random_solid(rng))
    if field is None:
        return
    side = int(rng.choice(list(SIDES), p=list(SIDES.values())))
    dense = marched(field, side, 1.0)
    if len(dense.faces) < FEWEST_DENSE:
        return
    points = laid_onto(field, dense.vertices)
    surface = Reference(points, unit_gradient(field, points))
    for _ in range(EACH):
        on_surface = rng.random() < ON_SURFACE
        coarse = coarsen(points, dense.faces, _size(rng, len(dense.faces)), rng)
        if coarse is None:
            continue
        if on_surface:
            coarse = with_points(coarse, laid_onto(field, coarse.vertices))
        yield Pair("laid" if on_surface else "collapsed", coarse, surface)


def _framed(field: Field) -> Field | None:
    """Return the field moved and scaled so that its zero set just fits into [−1, 1]³."""
    try:
        seen = marched(field, FIRST_LOOK, FIRST_EXTENT)
    except (MeshError, ValueError):
        return None
    low, high = seen.vertices.min(axis=0), seen.vertices.max(axis=0)
    centre, reach = (low + high) / 2, float((high - low).max()) / 2 * MARGIN
    return lambda points: field(points * reach + centre) / reach


def _size(rng: np.random.Generator, dense_faces: int) -> int:
    largest = min(MOST, dense_faces // LEAST_REDUCTION)
    low, high = USUAL if rng.random() < USUALLY else (FEWEST, largest)
    return int(min(np.exp(rng.uniform(np.log(low), np.log(high))), largest))
