"""What a feature set is: named blocks of features, and the vertex data that they ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float

from pns_common.arrays import Array, namespace
from pns_common.frames import EdgeFrames, EdgeStencil
from pns_common.symmetry import Feature, Symmetries, edge_symmetries
from pns_common.topology import Topology

# Points (V, 3) and topology -> (V, M): what the features want to know of each vertex.
VertexFields = Callable[[Array, Topology], Array]


@dataclass(frozen=True)
class Block:
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
    blocks: tuple[Block, ...]
    vertex_fields: VertexFields | None = None

    def __call__(self, at: EdgeStencil, frames: EdgeFrames) -> Float[Array, "N K"]:
        """φ, one row for each edge."""
        columns = [column for block in self.blocks for column in block.columns(at, frames)]
        return namespace(at.a).stack(columns, axis=-1)

    @property
    def features(self) -> tuple[Feature, ...]:
        """How each of the K features behaves under the symmetries of the stencil."""
        return tuple(feature for block in self.blocks for feature in block.features)

    @property
    def count(self) -> int:
        """K."""
        return len(self.features)

    @property
    def symmetries(self) -> Symmetries:
        """The group that a network over these features is averaged over."""
        return edge_symmetries(self.features)

    def fields(self, points: Float[Array, "V 3"], topology: Topology) -> Array | None:
        """The vertex data of a level, (V, M), or None where none is asked for."""
        return None if self.vertex_fields is None else self.vertex_fields(points, topology)
