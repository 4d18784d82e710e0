"""The first numbers of a Draco bitstream: what it will cost to decode, read without decoding it.

Bitstream 2.2, which KHR_draco_mesh_compression names (google.github.io/draco/spec, §3 and §5).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ....errors import GltfError, UnsupportedFeature

_HEADER = struct.Struct("<5sBBBBH")
_MESH = 1
_SEQUENTIAL, _EDGEBREAKER = 0, 1
_HAS_METADATA = 0x8000
_VERSION = (2, 2)
# Metadata nest; real ones have a level or two.
_MAX_DEPTH = 16


@dataclass(frozen=True)
class DracoHeader:
    """What a bitstream says of itself.

    Attributes:
        faces: triangles.
        points: at most so many vertices.
        tables: connectivities of their own that attributes have, beside the mesh's.
    """

    faces: int
    points: int
    tables: int


def read_header(data: bytes, pointer: str) -> DracoHeader:
    """Read the counts at the start of a mesh.

    Raises:
        GltfError: no Draco mesh, cut off, or counts that contradict each other.
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
    # Seams of attributes can make each corner a vertex of its own, and no more.
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
        """Read an unsigned LEB128 number of at most 32 bits."""
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
