"""Meshes that stand on the same accessors, as copies of one in other materials do."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

from ..read.modes import SURFACES
from ..read.schema import Document, Primitive


@dataclass
class SameGeometry:
    """The meshes that were refined so far, by what their surfaces stand on."""

    document: Document
    first: dict[Hashable, int] = field(default_factory=dict)

    def before(self, mesh: int) -> int:
        """Return the first mesh with the geometry of this one; itself where there is none."""
        primitives = self.document.meshes[mesh].primitives
        key = tuple(_geometry(p) if p.mode in SURFACES else None for p in primitives)
        return self.first.setdefault(key, mesh)


def _geometry(primitive: Primitive) -> Hashable:
    targets = tuple(tuple(target.items()) for target in primitive.targets)
    return primitive.mode, primitive.indices, tuple(primitive.attributes.items()), targets
