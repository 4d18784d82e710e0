"""Meshes that stand on the same accessors, as copies of one in other materials do."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable

from ..read.modes import SURFACES
from ..read.schema import Document, Primitive


def same_geometry(document: Document, meshes: Iterable[int]) -> dict[int, list[int]]:
    """Return the first mesh of each geometry, and the later ones that have the same."""
    alike: defaultdict[Hashable, list[int]] = defaultdict(list)
    for mesh in meshes:
        primitives = document.meshes[mesh].primitives
        alike[tuple(_geometry(p) if p.mode in SURFACES else None for p in primitives)].append(mesh)
    return {first: later for first, *later in alike.values()}


def _geometry(primitive: Primitive) -> Hashable:
    targets = tuple(tuple(target.items()) for target in primitive.targets)
    return primitive.mode, primitive.indices, tuple(primitive.attributes.items()), targets
