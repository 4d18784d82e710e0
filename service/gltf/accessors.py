"""Accessors: how elements lie in a buffer view (glTF 2.0 §3.6.2), and views of them as arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped

from service.gltf.schema import Accessor, BufferView, Document

COMPONENT_TYPES = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MATRIX_ROWS = {"MAT2": 2, "MAT3": 3, "MAT4": 4}

FLOAT = 5126
UNSIGNED_INTEGERS = (5121, 5123, 5125)


def element_size(accessor: Accessor) -> int:
    """Bytes of one element; each column of a matrix begins at a multiple of four bytes."""
    component = COMPONENT_TYPES[accessor.component_type].itemsize
    rows = _MATRIX_ROWS.get(accessor.type)
    if rows is None:
        return component * COMPONENT_COUNTS[accessor.type]
    column = rows * component
    return rows * (column + -column % 4)


def extent(accessor: Accessor, buffer_view: BufferView) -> int:
    """Bytes from the view's start to the end of the accessor's last element."""
    size = element_size(accessor)
    stride = buffer_view.byte_stride or size
    return accessor.byte_offset + stride * (accessor.count - 1) + size


def is_padded(accessor: Accessor) -> bool:
    """Whether a matrix's columns have gaps between them."""
    packed = COMPONENT_TYPES[accessor.component_type].itemsize * COMPONENT_COUNTS[accessor.type]
    return element_size(accessor) != packed


def read(
    document: Document, buffers: Sequence[memoryview], accessor: Accessor
) -> Shaped[np.ndarray, "N K"]:
    """The accessor's elements as a read-only view of the file's bytes: nothing is copied.

    The document has been checked: the accessor has a buffer view, lies inside it, is not sparse and
    not padded.
    """
    buffer_view = document.buffer_views[accessor.buffer_view or 0]
    dtype = COMPONENT_TYPES[accessor.component_type]
    return np.ndarray(
        shape=(accessor.count, COMPONENT_COUNTS[accessor.type]),
        dtype=dtype,
        buffer=buffers[buffer_view.buffer],
        offset=buffer_view.byte_offset + accessor.byte_offset,
        strides=(buffer_view.byte_stride or element_size(accessor), dtype.itemsize),
    )
