"""An endless, seeded stream of coarse meshes with their surfaces, for training to limit surfaces.

Closed solids of every size first, then open patches on analytic surfaces, grids of quads, spheres,
solids of plane faces, control meshes that were made for Loop, parts of a lathe, and swept profiles.
"""

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import numpy as np

from pns_common.reference_length import measure_reference_length
from train.data.pairs.authored import authored_pair
from train.data.pairs.faceted import faceted_pair
from train.data.pairs.grid import grid_pair
from train.data.pairs.lathe import lathe_pair
from train.data.pairs.references import Pair, moved, patch_pair, sphere_pair
from train.data.pairs.solid import solid_pairs
from train.data.pairs.swept import swept_pair

# How often each draws a pair, in the order that a seed means; the rest are solids.
SHARES: Mapping[Callable[[np.random.Generator], Pair | None], float] = MappingProxyType(
    {
        patch_pair: 0.14,
        grid_pair: 0.12,
        sphere_pair: 0.05,
        faceted_pair: 0.14,
        authored_pair: 0.08,
        lathe_pair: 0.09,
        swept_pair: 0.10,
    }
)

MOST_FACES = 2500


def pair_stream(seed: int) -> Iterator[Pair]:
    """Yield all pairs of a seed, without end: centred, with reference length R = 1."""
    rng = np.random.default_rng(seed)
    waiting: list[Pair] = []
    makers, ends = list(SHARES), np.cumsum(list(SHARES.values()))
    while True:
        kind = int(np.searchsorted(ends, rng.random()))
        if kind < len(makers):
            pair = makers[kind](rng)
        else:
            waiting = waiting or list(solid_pairs(rng))
            pair = waiting.pop() if waiting else None
        if pair is not None and len(pair.coarse.faces) <= MOST_FACES:
            scale = 1 / measure_reference_length(
                pair.coarse.vertices, pair.coarse.faces.reshape(-1)
            )
            centre = pair.coarse.vertices.mean(axis=0)
            yield moved(pair, scale * np.eye(3), -scale * centre)
