"""Accessors: how elements lie in a buffer view (glTF 2.0 §3.6.2), and views of them as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import msgspec
import numpy as np
from jaxtyping import Int, Shaped

from ...errors import GltfError
from ..constants import COLUMNS, COMPONENT_COUNTS, COMPONENT_TYPES
from .schema import Accessor, Document, Sparse


def element_size(accessor: Accessor) -> int:
    """Return the bytes of one element; a matrix's columns begin at multiples of four bytes."""
    return _element_size(accessor.component_type, accessor.type)


@cache
def _element_size(component_type: int, kind: str) -> int:
    component = COMPONENT_TYPES[component_type].itemsize
    rows = COLUMNS.get(kind)
    if rows is None:
        return component * COMPONENT_COUNTS[kind]
    column = rows * component
    return rows * (column + -column % 4)


def is_padded(accessor: Accessor) -> bool:
    """Return whether a matrix's columns have gaps between them."""
    packed = COMPONENT_TYPES[accessor.component_type].itemsize * COMPONENT_COUNTS[accessor.type]
    return element_size(accessor) != packed


def read(
    document: Document, buffers: Sequence[memoryview], index: int
) -> Shaped[np.ndarray, "N K"]:
    """Read all elements of an accessor; a dense one is a view of the file's bytes, so read-only.

    Raises:
        GltfError: a sparse accessor whose indices do not ascend, or reach past its end.
    """
    accessor = document.accessors[index]
    if accessor.sparse is None and accessor.buffer_view is not None and not is_padded(accessor):
        return _stored(document, buffers, accessor, accessor.buffer_view).reshape(
            accessor.count, -1
        )
    return read_rows(document, buffers, index, np.arange(accessor.count))


def read_rows(
    document: Document, buffers: Sequence[memoryview], index: int, rows: Int[np.ndarray, " N"]
) -> Shaped[np.ndarray, "N K"]:
    """Read the elements `rows` of an accessor, sparse or dense; zeros where it has no bytes.

    Costs in proportion to the rows, whatever the accessor's count claims. The document has been
    checked: everything lies inside its buffer view, and the rows inside the accessor.

    Raises:
        GltfError: a sparse accessor whose indices do not ascend, or reach past its end.
    """
    accessor = document.accessors[index]
    width, dtype = COMPONENT_COUNTS[accessor.type], COMPONENT_TYPES[accessor.component_type]
    if accessor.buffer_view is None:
        values = np.zeros((len(rows), width), dtype=dtype)
    else:
        stored = _stored(document, buffers, accessor, accessor.buffer_view)
        values = stored[rows].reshape(len(rows), width)
    if accessor.sparse is not None:
        places = _sparse_places(document, buffers, accessor.sparse, accessor.count, index)
        slot = np.minimum(np.searchsorted(places, rows), len(places) - 1)
        replaced = np.flatnonzero(places[slot] == rows)
        part = accessor.sparse.values
        dense = msgspec.structs.replace(
            accessor, count=accessor.sparse.count, byte_offset=part.byte_offset
        )
        stored = _stored(document, buffers, dense, part.buffer_view, strided=False)
        values[replaced] = stored[slot[replaced]].reshape(len(replaced), width)
    return values


def _stored(
    document: Document,
    buffers: Sequence[memoryview],
    accessor: Accessor,
    buffer_view: int,
    *,
    strided: bool = True,
) -> Shaped[np.ndarray, "N ..."]:
    """View elements as they lie in the bytes: (N, K), or (N, columns, rows) of a matrix."""
    view = document.buffer_views[buffer_view]
    dtype = COMPONENT_TYPES[accessor.component_type]
    rows = COLUMNS.get(accessor.type)
    size = element_size(accessor)
    stride = (view.byte_stride if strided else None) or size
    return np.ndarray(
        shape=(
            accessor.count,
            *((COMPONENT_COUNTS[accessor.type],) if rows is None else (rows,) * 2),
        ),
        dtype=dtype,
        buffer=buffers[view.buffer],
        offset=view.byte_offset + accessor.byte_offset,
        strides=(stride, *(() if rows is None else (size // rows,)), dtype.itemsize),
    )


def _sparse_places(
    document: Document, buffers: Sequence[memoryview], sparse: Sparse, count: int, index: int
) -> Int[np.ndarray, " S"]:
    part = sparse.indices
    places = _stored(
        document,
        buffers,
        Accessor(part.component_type, sparse.count, "SCALAR", byte_offset=part.byte_offset),
        part.buffer_view,
        strided=False,
    ).reshape(-1)
    places = places.astype(np.int64)
    if places[-1] >= count or (places[1:] <= places[:-1]).any():
        raise GltfError(
            f"sparse indices must ascend and stay below {count}",
            pointer=f"/accessors/{index}/sparse/indices",
        )
    return places
