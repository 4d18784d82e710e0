"""An endless, seeded stream of coarse meshes with their surfaces, for training to limit surfaces.

Closed solids of every size first, then open patches on analytic surfaces, grids of quads, spheres,
solids of plane faces, parts drawn with few faces, and machined ones.
"""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from pns_common.mesh.reference_length import measure_reference_length
from train.data.pairs.faceted import faceted_pair
from train.data.pairs.grid import grid_pair
from train.data.pairs.lathe import lathe_pair
from train.data.pairs.machined import machined_pairs
from train.data.pairs.references import Pair, moved, patch_pair, sphere_pair
from train.data.pairs.solid import solid_pairs

Single = Callable[[np.random.Generator], Pair | None]
Several = Callable[[np.random.Generator], Iterator[Pair]]

# How often each draws a pair, in the order that a seed means.
SHARES: Mapping[Single, float] = {
    patch_pair: 0.12,
    grid_pair: 0.05,
    sphere_pair: 0.04,
    faceted_pair: 0.05,
    lathe_pair: 0.26,
}
# Makers of several pairs of one shape, which are drawn one by one.
SHARED: Mapping[Several, float] = {machined_pairs: 0.14, solid_pairs: 0.34}

MOST_FACES = 1200


def pair_stream(seed: int) -> Iterator[Pair]:
    """Yield all pairs of a seed, without end: centred, with reference length R = 1."""
    for pair in drawn_pairs(np.random.default_rng(seed), SHARES, SHARED):
        if pair.coarse.face_count <= MOST_FACES:
            yield pair


def drawn_pairs(
    rng: np.random.Generator, of_one: Mapping[Single, float], of_several: Mapping[Several, float]
) -> Iterator[Pair]:
    """Yield pairs of makers, as often as their shares say: centred, with reference length R = 1."""
    singles, several = list(of_one), list(of_several)
    waiting: list[list[Pair]] = [[] for _ in several]
    ends = np.cumsum([*of_one.values(), *of_several.values()])
    while True:
        kind = int(np.searchsorted(ends, rng.random()))
        if kind < len(singles):
            pair = singles[kind](rng)
        else:
            number = kind - len(singles)
            waiting[number] = waiting[number] or list(several[number](rng))
            pair = waiting[number].pop() if waiting[number] else None
        if pair is not None:
            scale = 1 / measure_reference_length(pair.coarse.vertices, pair.coarse.corners)
            centre = pair.coarse.vertices.mean(axis=0)
            yield moved(pair, scale * np.eye(3), -scale * centre)
