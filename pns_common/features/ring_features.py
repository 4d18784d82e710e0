"""The feature sets of old vertices that a model card may name.

``ring-10`` is a row of means over the spokes of each vertex: nothing in it depends on where the
ring starts, on its direction or on its length. Definitions, ranges and signs: docs/features.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from jaxtyping import Float

from pns_common.base.arrays import Array, dot, namespace
from pns_common.features.symmetry import Feature, Generator, Symmetries, symmetries
from pns_common.geometry.ring_sums import divided
from pns_common.geometry.rings import Rings, squared

# The square of a spoke without length, so that the root has a gradient.
SHORTEST_SQUARE = 1e-300
# Turned-over faces: the mean normal changes sign, sums of spokes do not.
RING_TURN_OVER = Generator("turn_over", "", "", (-1, 1, 1))


def ring_features(rings: Rings) -> Float[Array, "V 10"]:
    """Return the features of ``ring-10``, in the order of RING_10."""
    xp = namespace(rings.normal)
    spoke_length, height = rings.spoke_length, rings.height
    square = squared(rings.spokes)
    length = xp.sqrt(xp.where(square > 0, square, SHORTEST_SQUARE))
    tilt = rings.of_neighbour(rings.normal) - rings.of_centre(rings.normal)
    opening = rings.mean(dot(tilt, rings.spokes)[:, None])
    columns = [
        rings.mean_jump,
        rings.mean(rings.bend),
        rings.mean(rings.bend**2),
        height,
        divided(squared(rings.umbrella), rings.square),
        squared(rings.normal),
        rings.mean(rings.of_neighbour(height)),
        divided(opening, spoke_length),
        divided(rings.mean(length), spoke_length),
        rings.near_jump,
    ]
    return xp.concat(columns, axis=1)


@dataclass(frozen=True)
class RingFeatureSet:
    """Features of a vertex's ring; the name stands on the model card."""

    name: str
    features: tuple[Feature, ...]
    columns: Callable[[Rings], Array]

    def __call__(self, rings: Rings) -> Float[Array, "V K"]:
        """Return φ, one row for each vertex."""
        return self.columns(rings)

    @property
    def count(self) -> int:
        """K."""
        return len(self.features)

    @property
    def symmetries(self) -> Symmetries:
        """The group that a network over these features is averaged over."""
        return symmetries(self.features, [RING_TURN_OVER])


RING_10 = RingFeatureSet(
    "ring-10",
    (
        Feature("mean jump", limit=2.0),
        Feature("bend", turn_over=-1),
        Feature("bend squared"),
        Feature("umbrella height", turn_over=-1),
        Feature("umbrella length"),
        Feature("normal agreement"),
        Feature("neighbours' umbrella height", turn_over=-1),
        Feature("opening", turn_over=-1, limit=2.0),
        Feature("evenness"),
        Feature("neighbours' mean jump", limit=2.0),
    ),
    ring_features,
)
RING_FEATURE_SETS: Mapping[str, RingFeatureSet] = MappingProxyType({RING_10.name: RING_10})
