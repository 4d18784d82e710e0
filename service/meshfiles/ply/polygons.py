"""PLY whose polygons differ in size, cut into triangles: binary, and text by textured_text.py.

trimesh reads those of one size alone, and Blender writes a mesh's quads and triangles as they are.
"""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Int

from ...errors import UnreadableError
from ..fans import fans
from .header import Element, PlyHeader, Property, ply_header
from .textured_text import of_textured_triangles

_FACES = re.compile(rb"^element face \d+", re.MULTILINE)


def of_triangles(data: bytes) -> tuple[bytes, int | None]:
    """Return a PLY that trimesh reads, and how many polygons became its triangles.

    None: it is the same file. What faces hold beside their vertices is 0 in the other: it is lost
    in any case, and its name stays to be told.

    Raises:
        UnreadableError: it ends before its last face, or a face is not what the header says.
    """
    header = ply_header(data)
    if header is not None and header.order is None:
        return of_textured_triangles(data, header)
    found = None if header is None else header.faces_at()
    if header is None or found is None:
        return data, None
    faces, begin = found
    places = faces.polygons()
    if places is None or faces.rows == 0 or _of_one_size(data, header, faces, begin, places):
        return data, None
    sizes, corners, end = _corners(data, header, faces, begin, places)
    triangles = fans(sizes, corners)
    before, polygon, behind = places
    row = np.dtype(
        [
            ("before", "u1", (before,)),
            ("count", f"{header.order}{polygon.count_kind}"),
            ("corners", f"{header.order}{polygon.kind}", (3,)),
            ("behind", "u1", (behind,)),
        ]
    )
    rows = np.zeros(len(triangles), dtype=row)
    rows["count"], rows["corners"] = 3, triangles
    head = _FACES.sub(b"element face %d" % len(triangles), data[: header.end])
    return b"".join([head, data[header.end : begin], rows.tobytes(), data[end:]]), faces.rows


def _of_one_size(
    data: bytes, header: PlyHeader, faces: Element, begin: int, places: tuple[int, Property, int]
) -> bool:
    """Return whether all polygons have as many corners as the first."""
    before, polygon, behind = places
    kind = np.dtype(f"{header.order}{polygon.count_kind}")
    at = begin + before
    if at + kind.itemsize > len(data):
        return True
    first = int(np.frombuffer(data, kind, 1, at)[0])
    stride = before + kind.itemsize + first * polygon.size + behind
    if first < 0 or begin + faces.rows * stride > len(data):
        return False
    counts: np.ndarray = np.ndarray(faces.rows, kind, data, at, (stride,))
    return bool((counts == first).all())


def _corners(
    data: bytes, header: PlyHeader, faces: Element, begin: int, places: tuple[int, Property, int]
) -> tuple[Int[np.ndarray, " F"], Int[np.ndarray, " C"], int]:
    """Return how many corners each polygon has, all of them in a row, and where they end."""
    before, polygon, behind = places
    kind = np.dtype(f"{header.order}{polygon.count_kind}")
    order = "little" if header.order == "<" else "big"
    signed, width = kind.kind == "i", kind.itemsize
    sizes = np.empty(min(faces.rows, len(data)), dtype=np.int64)
    pieces: list[bytes] = []
    at = begin
    # One by one: where a polygon lies hangs on the sizes of all before it.
    for face in range(faces.rows):
        at += before
        size = int.from_bytes(data[at : at + width], order, signed=signed)
        at += width
        behind_corners = at + size * polygon.size
        if size < 0 or behind_corners + behind > len(data):
            raise UnreadableError(f"the PLY file says {faces.rows} faces and ends after {face}")
        sizes[face] = size
        pieces.append(data[at:behind_corners])
        at = behind_corners + behind
    corners = np.frombuffer(b"".join(pieces), dtype=f"{header.order}{polygon.kind}")
    return sizes, corners, at
