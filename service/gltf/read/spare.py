"""What a document's surfaces stand on: it may leave the file once refinement has replaced them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from .modes import SURFACES
from .schema import Document


@dataclass(frozen=True)
class Spare:
    """What refinement may leave without use.

    Attributes:
        accessors, views: the file's own, that surfaces use; all later ones are spare as well.
        accessor_count, view_count: how many the file had.
        ranges: (buffer, start, end) of compressed data that have been decoded.
        unknown: extensions that may point at any of it.
    """

    accessors: frozenset[int]
    views: frozenset[int]
    accessor_count: int
    view_count: int
    ranges: tuple[tuple[int, int, int], ...]
    unknown: tuple[str, ...]


def spare(
    document: Document,
    draco_views: Iterable[int],
    ranges: Iterable[tuple[int, int, int]],
    unknown: Iterable[str],
) -> Spare:
    """Return what the surfaces of a document, as it came, stand on."""
    accessors: set[int] = set()
    for mesh in document.meshes:
        for primitive in mesh.primitives:
            if primitive.mode in SURFACES:
                accessors.update(index for _, index in primitive.named)
                accessors |= set() if primitive.indices is None else {primitive.indices}
    views = set(draco_views)
    for index in accessors:
        if index < len(document.accessors):
            accessor = document.accessors[index]
            views |= set() if accessor.buffer_view is None else {accessor.buffer_view}
            if accessor.sparse is not None:
                views |= {accessor.sparse.indices.buffer_view, accessor.sparse.values.buffer_view}
    return Spare(
        frozenset(accessors),
        frozenset(views),
        len(document.accessors),
        len(document.buffer_views),
        tuple(ranges),
        tuple(unknown),
    )
