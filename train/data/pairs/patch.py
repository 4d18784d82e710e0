"""Open patches on analytic surfaces, for training to limit surfaces."""

import numpy as np

from pns_common import loop
from train.data.pairs.references import Pair, Reference
from train.data.stream import random_instance
from train.refining import refine
from train.surfaces.implicit import unit_normal

LEVELS, PROJECTIONS = 3, 4


def patch_pair(rng: np.random.Generator) -> Pair:
    """Return a patch of `train.data.stream`, its surface by Loop's mesh laid onto it."""
    instance = random_instance(rng)
    surface = instance.surface
    points = refine(instance.mesh, loop(), LEVELS, 1.0).mesh.vertices
    for _ in range(PROJECTIONS):
        slope = surface.gradient(points)
        points = points - (surface.value(points) / (slope**2).sum(axis=1))[:, None] * slope
    return Pair("patch", instance.mesh, Reference(points, unit_normal(surface, points)))
