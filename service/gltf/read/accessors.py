"""Read accessors as arrays: layout (glTF 2.0 §3.6.2), and integers that stand for floats."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import msgspec
import numpy as np
from jaxtyping import Int, Shaped

from ...errors import GltfError
from ..constants import (
    BYTE,
    COLUMNS,
    COMPONENT_COUNTS,
    COMPONENT_TYPES,
    FLOAT,
    SHORT,
    UNSIGNED_BYTE,
    UNSIGNED_SHORT,
)
from .schema import Accessor, Document, Sparse

QUANTIZATION = "KHR_mesh_quantization"

# Integer encodings (component type, normalized) by attribute: those of glTF 2.0 itself, then those
# of the extension.
_CORE_TEXCOORD = {(UNSIGNED_BYTE, True), (UNSIGNED_SHORT, True)}
_SIGNED_FRACTIONS = {(BYTE, True), (SHORT, True)}
_ALL = {(kind, flag) for kind in range(BYTE, UNSIGNED_SHORT + 1) for flag in (False, True)}


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
    """Read all elements of an accessor; those of a dense one are a read-only view of the bytes.

    Raises:
        GltfError: the indices of a sparse accessor do not ascend, or reach past its end.
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
    """Read some elements of an accessor, sparse or dense; zeros where it has no bytes.

    The document is checked: elements lie inside their views, and rows inside the accessor. The cost
    is proportional to the rows, whatever the accessor's count.

    Raises:
        GltfError: the indices of a sparse accessor do not ascend, or reach past its end.
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
    """Return a view of the elements in the bytes: (N, K), or (N, columns, rows) of matrices."""
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


def is_dequantised(name: str) -> bool:
    """Return whether an attribute is written as float32, however it was stored."""
    return name in ("POSITION", "NORMAL", "TANGENT") or name.startswith("TEXCOORD_")


def allowed(name: str) -> set[tuple[int, bool]]:
    """Return the integer encodings that the extension allows: (component type, normalized)."""
    return _SIGNED_FRACTIONS if name in ("NORMAL", "TANGENT") else _ALL


def needs_extension(name: str, component_type: int, *, normalized: bool) -> bool:
    """Return whether an attribute so stored is valid only with KHR_mesh_quantization."""
    if not is_dequantised(name) or component_type == FLOAT:
        return False
    core = _CORE_TEXCOORD if name.startswith("TEXCOORD_") else set()
    return (component_type, normalized) not in core


def dequantised(
    name: str, values: Shaped[np.ndarray, "N K"], accessor: Accessor
) -> tuple[Shaped[np.ndarray, "N K"], Accessor]:
    """Return the values to refine and write, and an accessor that describes them.

    Positions, normals, tangents and texture coordinates become float32.
    """
    if not is_dequantised(name) or accessor.component_type == FLOAT:
        return values, accessor
    plain = msgspec.structs.replace(accessor, component_type=FLOAT, normalized=False)
    return as_float(values, normalized=accessor.normalized), plain


def as_float(values: Shaped[np.ndarray, "N K"], *, normalized: bool) -> Shaped[np.ndarray, "N K"]:
    """Return integers as float32. Normalized ones are c / max, at least −1 (glTF §3.6.2.2)."""
    if not normalized:
        return values.astype(np.float32)
    fractions = values.astype(np.float64) / np.iinfo(values.dtype).max
    return np.maximum(fractions, -1.0).astype(np.float32)


def still_needed(tree: dict[str, Any]) -> bool:
    """Return whether an attribute or morph target of a document needs KHR_mesh_quantization."""
    accessors = tree.get("accessors", [])
    return any(
        needs_extension(
            name,
            accessors[index]["componentType"],
            normalized=accessors[index].get("normalized", False),
        )
        for mesh in tree.get("meshes", [])
        for primitive in mesh.get("primitives", [])
        for attributes in (primitive["attributes"], *primitive.get("targets", []))
        for name, index in attributes.items()
    )
