"""What a feature set is: named groups of features, and the vertex data that they ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float

from pns_common.base.arrays import Array, namespace
from pns_common.features.symmetry import Feature, Symmetries, edge_symmetries
from pns_common.geometry.frames import EdgeFrames, EdgeStencil
from pns_common.geometry.rings import Rings

# Rings of V vertices -> (V, M): what the features want to know of each vertex.
VertexFields = Callable[[Rings], Array]


@dataclass(frozen=True)
class FeatureGroup:
    """Features that belong together: one column each, in the order of ``features``."""

    name: str
    features: tuple[Feature, ...]
    columns: Callable[[EdgeStencil, EdgeFrames], list[Array]]


@dataclass(frozen=True)
class FeatureSet:
    """Rigid-invariant features of interior edges; the name stands on the model card.

    ``vertex_fields`` is computed once a level where it is not None, and then read from
    ``EdgeStencil.fields``.
    """

    name: str
    groups: tuple[FeatureGroup, ...]
    vertex_fields: VertexFields | None = None

    def __call__(self, stencil: EdgeStencil, frames: EdgeFrames) -> Float[Array, "N K"]:
        """Return φ, one row for each edge."""
        columns = [column for group in self.groups for column in group.columns(stencil, frames)]
        return namespace(stencil.a).stack(columns, axis=-1)

    @property
    def features(self) -> tuple[Feature, ...]:
        """How each of the K features behaves under the symmetries of the stencil."""
        return tuple(feature for group in self.groups for feature in group.features)

    @property
    def count(self) -> int:
        """K."""
        return len(self.features)

    @property
    def symmetries(self) -> Symmetries:
        """The group that a network over these features is averaged over."""
        return edge_symmetries(self.features)

    def fields(self, rings: Rings) -> Array | None:
        """Return the vertex data of a level, (V, M), or None where none is asked for."""
        return None if self.vertex_fields is None else self.vertex_fields(rings)
