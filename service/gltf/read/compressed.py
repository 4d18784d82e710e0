"""Decode compressed geometry: meshopt buffer views and Draco primitives."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import DracoPy
import meshopt
import numpy as np
from jaxtyping import Shaped

from ...errors import GltfError, UnsupportedFeature
from ...memory_cap import memory_cap
from ...options import Limits
from ..constants import COMPONENT_COUNTS, COMPONENT_TYPES, STRIP, TRIANGLES, UNSIGNED_INT
from .extensions import drop, withdraw
from .plan import check_decoded
from .references import refer
from .schema import Document, Index, Part, Primitive, Size, checked

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_ROW_BYTES = {"OCTAHEDRAL": (4, 8), "COLOR": (4, 8), "QUATERNION": (8,)}

DRACO = "KHR_draco_mesh_compression"

# Peak bytes of decoding: at least twice what was measured on 200,000 and 320,000 faces with normals
# and UVs (138 to 355 a face).
BYTES_PER_FACE = 300
BYTES_PER_FACE_AND_TABLE = 120
BYTES_PER_POINT_AND_ATTRIBUTE = 80
# Reserve of the allocator.
SLACK = 64 * 2**20

_HEADER = struct.Struct("<5sBBBBH")
_MESH = 1
_SEQUENTIAL, _EDGEBREAKER = 0, 1
_HAS_METADATA = 0x8000
_VERSION = (2, 2)
# Real metadata has a level or two.
_MAX_DEPTH = 16


class CompressedView(Part, frozen=True):
    """The extension's object in a buffer view."""

    buffer: Index
    byte_length: Size
    byte_stride: Size
    count: Size
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Index = 0
    filter: Literal["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"] = "NONE"


@dataclass(frozen=True)
class _Packed:
    number: int
    name: str
    view: CompressedView

    @property
    def pointer(self) -> str:
        return f"/bufferViews/{self.number}/extensions/{self.name}"


def needed_buffers(document: Document) -> set[int]:
    """Return the buffers that hold views; the placeholder buffers of compressed views do not."""
    return {
        view.buffer for view in document.buffer_views if view.extensions.keys().isdisjoint(MESHOPT)
    }


def decode_views(
    tree: dict[str, Any],
    document: Document,
    buffers: list[memoryview],
    size: int,
    limits: Limits,
) -> list[tuple[int, int, int]]:
    """Decode each view under EXT_ or KHR_meshopt_compression into a buffer of its own.

    Returns (buffer, start, end) of the compressed data, which is no longer needed. The decoded size
    is checked first. Edits the tree and appends to `buffers`. `size` is the upload's in bytes.

    Raises:
        GltfError: an invalid extension object, or data that do not decode.
        LimitError: the decoded bytes take more memory than allowed.
    """
    packed = [
        _Packed(number, name, _checked_view(view.extensions[name], view.byte_length, number, name))
        for number, view in enumerate(document.buffer_views)
        if view.extensions
        for name in MESHOPT
        if name in view.extensions
    ]
    if packed:
        check_decoded(sum(f.view.count * f.view.byte_stride for f in packed), size, limits)
    decoded = [_decode_view(entry, buffers) for entry in packed]
    for entry, data in zip(packed, decoded, strict=True):
        view = tree["bufferViews"][entry.number]
        view |= {"buffer": len(buffers), "byteOffset": 0}
        drop(view, entry.name)
        tree["buffers"].append({"byteLength": len(data)})
        buffers.append(data)
    for name in MESHOPT:
        withdraw(tree, name)
        for buffer in tree.get("buffers", []):
            drop(buffer, name)
    return [
        (f.view.buffer, f.view.byte_offset, f.view.byte_offset + f.view.byte_length) for f in packed
    ]


def _checked_view(value: Any, length: int, number: int, name: str) -> CompressedView:
    pointer = f"/bufferViews/{number}/extensions/{name}"
    view = checked(value, CompressedView, pointer)
    stride, count = view.byte_stride, view.count
    if count * stride != length:
        raise GltfError(
            f"{count} elements of {stride} bytes in a view of {length}", pointer=f"{pointer}/count"
        )
    if view.mode == "ATTRIBUTES":
        right = (
            stride % 4 == 0 and stride <= 256 and stride in _ROW_BYTES.get(view.filter, (stride,))
        )
    else:
        right = stride in (2, 4) and view.filter == "NONE"
        right = right and (view.mode == "INDICES" or count % 3 == 0)
    if not right:
        raise GltfError(
            f"{view.mode} of {count} elements of {stride} bytes, filter {view.filter}",
            pointer=pointer,
        )
    return view


def _decode_view(entry: _Packed, buffers: Sequence[memoryview]) -> memoryview:
    view = entry.view
    refer(view.buffer, buffers, f"{entry.pointer}/buffer")
    end = view.byte_offset + view.byte_length
    if end > len(buffers[view.buffer]):
        raise GltfError(
            f"the data end at byte {end} of {len(buffers[view.buffer])}", pointer=entry.pointer
        )
    data = bytes(buffers[view.buffer][view.byte_offset : end])
    try:
        decoded = meshopt.decode_gltf_buffer(
            data, view.count, view.byte_stride, view.mode, view.filter
        )
    except (ValueError, RuntimeError) as error:
        raise GltfError(f"the data do not decode: {error}", pointer=entry.pointer) from error
    return np.ascontiguousarray(decoded).reshape(-1).view(np.uint8).data.cast("B")


class DracoPrimitive(Part, frozen=True):
    """The extension's object in a primitive."""

    buffer_view: Index
    attributes: dict[str, Index]


def decode_primitives(
    tree: dict[str, Any],
    document: Document,
    buffers: list[memoryview],
    size: int,
    limits: Limits,
) -> list[int]:
    """Decode KHR_draco_mesh_compression to plain accessors; return the views of compressed data.

    The header's counts are checked before decoding. Attributes that no primitive names are bounded
    by a cap on the decoder's memory. Edits the tree and appends to `buffers`; buffer views have
    been checked. `size` is the upload's in bytes.

    Raises:
        GltfError: the data do not decode, or do not match the primitive.
        UnsupportedFeature: another version of the bitstream.
        LimitError: decoding takes more memory than allowed.
    """
    views: list[int] = []
    held = size + sum(len(buffer) for buffer in buffers)
    for mesh_number, mesh in enumerate(document.meshes):
        for place, primitive in enumerate(mesh.primitives):
            if DRACO in primitive.extensions:
                pointer = f"/meshes/{mesh_number}/primitives/{place}"
                decoded = _decode_primitive(document, buffers, primitive, pointer, held, limits)
                entry = tree["meshes"][mesh_number]["primitives"][place]
                entry_view = entry["extensions"][DRACO]["bufferView"]
                _store(tree, buffers, entry, decoded)
                held += sum(values.nbytes for values in decoded.values())
                views.append(entry_view)
    withdraw(tree, DRACO)
    return views


def _decode_primitive(
    document: Document,
    buffers: list[memoryview],
    primitive: Primitive,
    pointer: str,
    held: int,
    limits: Limits,
) -> dict[str | None, Shaped[np.ndarray, "N K"]]:
    """Return the decoded attributes by name, and the indices under None."""
    here = f"{pointer}/extensions/{DRACO}"
    wanted = checked(primitive.extensions[DRACO], DracoPrimitive, here)
    if primitive.mode not in (TRIANGLES, STRIP):
        raise GltfError("Draco holds triangles only", pointer=f"{pointer}/mode")
    refer(wanted.buffer_view, document.buffer_views, f"{here}/bufferView")
    view = document.buffer_views[wanted.buffer_view]
    data = bytes(buffers[view.buffer][view.byte_offset : view.byte_offset + view.byte_length])
    header = read_header(data, here)
    need = header.faces * (BYTES_PER_FACE + BYTES_PER_FACE_AND_TABLE * header.tables)
    need += header.points * BYTES_PER_POINT_AND_ATTRIBUTE * len(wanted.attributes)
    check_decoded(need, held, limits)
    _check_claim(document, primitive, header.faces, pointer)
    most = need + SLACK
    text = f"the Draco data take more than {most} bytes, which their header accounts for"
    try:
        with memory_cap(most, text):
            mesh = DracoPy.decode(data)
    except (DracoPy.FileTypeException, TypeError, ValueError) as error:
        raise GltfError(f"the data do not decode: {error}", pointer=here) from error
    faces = getattr(mesh, "faces", None)
    if faces is None or not len(faces):
        raise GltfError("the Draco data hold no triangle", pointer=here)
    decoded: dict[str | None, Shaped[np.ndarray, "N K"]] = {None: faces.reshape(-1, 1)}
    data_of = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    for name, identity in wanted.attributes.items():
        index = primitive.attributes.get(name)
        if index is None or index >= len(document.accessors):
            raise GltfError(f"{name} has no accessor", pointer=f"{here}/attributes")
        accessor = document.accessors[index]
        values = data_of.get(identity)
        if values is None or values.shape[1] != COMPONENT_COUNTS[accessor.type]:
            raise GltfError(
                f"the Draco data hold no {accessor.type} under {identity}, for {name}",
                pointer=f"{here}/attributes",
            )
        decoded[name] = _as_type(values, COMPONENT_TYPES[accessor.component_type], index)
    return decoded


def _check_claim(document: Document, primitive: Primitive, faces: int, pointer: str) -> None:
    """Refuse more triangles than the primitive claims, by which the job is charged."""
    index = primitive.indices
    if index is None or index >= len(document.accessors):
        raise GltfError("compressed triangles need indices", pointer=pointer)
    corners = document.accessors[index].count
    claimed = corners // 3 if primitive.mode == TRIANGLES else corners - 2
    if faces > claimed:
        raise GltfError(
            f"the Draco data hold {faces} triangles, the indices are those of {claimed}",
            pointer=f"/accessors/{index}/count",
        )


def _as_type(
    values: Shaped[np.ndarray, "N K"], dtype: np.dtype[Any], index: int
) -> Shaped[np.ndarray, "N K"]:
    """Return the values in the component type of the accessor. Raises GltfError where none fits."""
    if dtype.kind != "f":
        bounds = np.iinfo(dtype)
        # The decoder returns normalised integers as whole floats.
        whole = values.dtype.kind in "iu" or bool((values == np.rint(values)).all())
        if not whole or values.min() < bounds.min or values.max() > bounds.max:
            raise GltfError(
                f"the Draco values do not fit {dtype.name}",
                pointer=f"/accessors/{index}/componentType",
            )
    return np.ascontiguousarray(values, dtype=dtype)


def _store(
    tree: dict[str, Any],
    buffers: list[memoryview],
    primitive: dict[str, Any],
    decoded: dict[str | None, Shaped[np.ndarray, "N K"]],
) -> None:
    """Add accessors for a primitive; others may share the old ones."""
    for name, values in decoded.items():
        accessors = tree["accessors"]
        holder, key = (primitive, "indices") if name is None else (primitive["attributes"], name)
        gone = ("bufferView", "byteOffset", "sparse")
        accessor = {k: value for k, value in accessors[holder[key]].items() if k not in gone}
        if name is None:
            accessor |= {"componentType": UNSIGNED_INT, "type": "SCALAR"}
        holder[key] = len(accessors)
        data = values.data.cast("B")
        accessor |= {"bufferView": len(tree["bufferViews"]), "count": len(values)}
        accessors.append(accessor)
        tree["bufferViews"].append({"buffer": len(buffers), "byteLength": len(data)})
        tree["buffers"].append({"byteLength": len(data)})
        buffers.append(data)
    primitive.pop("mode", None)
    drop(primitive, DRACO)


@dataclass(frozen=True)
class DracoHeader:
    """Counts at the start of a Draco bitstream (version 2.2, google.github.io/draco/spec, §3, §5).

    Attributes:
        faces: triangles.
        points: an upper bound of the vertices.
        tables: connectivities of single attributes, in addition to the mesh's.
    """

    faces: int
    points: int
    tables: int


def read_header(data: bytes, pointer: str) -> DracoHeader:
    """Read the counts that decoding depends on.

    Raises:
        GltfError: no Draco mesh, truncated, or with contradicting counts.
        UnsupportedFeature: another version of the bitstream.
    """
    if len(data) < _HEADER.size:
        raise GltfError("the data are shorter than a Draco header", pointer=pointer)
    magic, major, minor, kind, method, flags = _HEADER.unpack_from(data)
    if magic != b"DRACO" or kind != _MESH or method not in (_SEQUENTIAL, _EDGEBREAKER):
        raise GltfError("the data are no Draco mesh", pointer=pointer)
    if (major, minor) != _VERSION:
        raise UnsupportedFeature(f"Draco bitstream {major}.{minor}", pointer=pointer)
    cursor = _Cursor(data, _HEADER.size, pointer)
    if flags & _HAS_METADATA:
        for _ in range(cursor.varint()):
            cursor.varint()
            _skip_metadata(cursor, 0)
        _skip_metadata(cursor, 0)
    if method == _SEQUENTIAL:
        faces, points = cursor.varint(), cursor.varint()
        return DracoHeader(faces, points, 0)
    cursor.skip(1)
    vertices, faces = cursor.varint(), cursor.varint()
    tables = cursor.byte()
    cursor.varint()
    splits = cursor.varint()
    # With seams everywhere each corner is a vertex.
    if vertices > 3 * faces or splits > faces:
        raise GltfError(
            f"{faces} faces with {vertices} vertices and {splits} splits", pointer=pointer
        )
    return DracoHeader(faces, 3 * faces, tables)


@dataclass
class _Cursor:
    data: bytes
    offset: int
    pointer: str

    def byte(self) -> int:
        self.skip(1)
        return self.data[self.offset - 1]

    def skip(self, count: int) -> None:
        self.offset += count
        if self.offset > len(self.data):
            raise GltfError("the Draco data are cut off", pointer=self.pointer)

    def varint(self) -> int:
        """Read an unsigned LEB128 number of up to 32 bits."""
        value = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise GltfError("a Draco number does not end", pointer=self.pointer)


def _skip_metadata(cursor: _Cursor, depth: int) -> None:
    if depth > _MAX_DEPTH:
        raise GltfError("Draco metadata nest too deep", pointer=cursor.pointer)
    for _ in range(cursor.varint()):
        cursor.skip(cursor.byte())
        cursor.skip(cursor.varint())
    for _ in range(cursor.varint()):
        cursor.skip(cursor.byte())
        _skip_metadata(cursor, depth + 1)
