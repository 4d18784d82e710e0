"""An endless, seeded stream of coarse meshes with their surfaces, for training to limit surfaces.

Closed solids of every size first, then open patches on analytic surfaces, grids of quads, spheres,
solids of plane faces, control meshes that were made for Loop, parts of a lathe, and swept profiles.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from pns_common.refine import measure_reference_length, refine
from pns_common.schemes import loop
from train.data.authored_pairs import authored_pair
from train.data.faceted_pairs import faceted_pair
from train.data.grid_pairs import grid_pair
from train.data.lathe_pairs import lathe_pair
from train.data.references import Pair, Reference, moved
from train.data.solid_pairs import solid_pairs
from train.data.sphere_pairs import sphere_pair
from train.data.stream import random_instance
from train.data.swept_pairs import swept_pair
from train.surfaces.implicit import unit_normal

SHARES: Mapping[str, float] = MappingProxyType(
    {
        "patches": 0.14,
        "grids": 0.12,
        "spheres": 0.05,
        "faceted": 0.14,
        "authored": 0.08,
        "lathes": 0.09,
        "swept": 0.10,
    }
)
"""Of these kinds; the rest are solids."""

MOST_FACES = 2500
PATCH_LEVELS, PROJECTIONS = 3, 4


def pair_stream(seed: int) -> Iterator[Pair]:
    """Yield all pairs of a seed, without end: centred, with reference length R = 1."""
    rng = np.random.default_rng(seed)
    waiting: list[Pair] = []
    makers = (
        patch_pair,
        grid_pair,
        sphere_pair,
        faceted_pair,
        authored_pair,
        lathe_pair,
        swept_pair,
    )
    shares = np.cumsum(list(SHARES.values()))
    while True:
        kind = int(np.searchsorted(shares, rng.random()))
        if kind < len(makers):
            pair = makers[kind](rng)
        else:
            waiting = waiting or list(solid_pairs(rng))
            pair = waiting.pop() if waiting else None
        if pair is not None and len(pair.coarse.faces) <= MOST_FACES:
            scale = 1 / measure_reference_length(pair.coarse.vertices, pair.coarse.faces)
            centre = pair.coarse.vertices.mean(axis=0)
            yield moved(pair, scale * np.eye(3), -scale * centre)


def patch_pair(rng: np.random.Generator) -> Pair:
    """Return an open patch of `train.data.stream`, its surface by Loop's mesh laid onto it."""
    instance = random_instance(rng)
    surface = instance.surface
    points = refine(instance.mesh, loop(), PATCH_LEVELS, 1.0, threads=1).mesh.vertices
    for _ in range(PROJECTIONS):
        slope = surface.gradient(points)
        points = points - (surface.value(points) / (slope**2).sum(axis=1))[:, None] * slope
    return Pair("patch", instance.mesh, Reference(points, unit_normal(surface, points)))
