"""The Object File Format: text, faces with any number of corners.

trimesh 5 stops at faces with more than four corners, and those are what OFF files are used for.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from itertools import chain, islice

import numpy as np
from jaxtyping import Float

from ..errors import UnreadableError
from .fans import fans
from .indexed_triangles import NUMBER, IndexedTriangles
from .text_numbers import reals, whole
from .text_pieces import COMMENT
from .unsupported import SIDES

# Lines whose words are held at the same time.
BLOCK = 2**14

_HEADER = re.compile(rb"(?:\xef\xbb\xbf)?\s*((?:ST)?C?N?)OFF\b")
_COUNTS = re.compile(rb"\s*(\d{1,18})\s+(\d{1,18})(?:[ \t]+\d+)?[ \t]*\r?\n")

_CUT_OFF = "the OFF file ends before its last face, or has none"
_NO_FACE = "the OFF file has a face that is not a count and as many vertices"


def read_off(data: bytes) -> IndexedTriangles:
    """Read positions and faces, polygons split into fans; colours and normals are passed over.

    Raises:
        UnreadableError: not a text OFF file, or one without faces.
    """
    text = COMMENT.sub(b"", data)
    header = _HEADER.match(text)
    counts = _COUNTS.match(text, header.end() if header else 0)
    if header is None or counts is None:
        raise UnreadableError("this is not a readable OFF file: no header")
    vertex_count, face_count = int(counts[1]), int(counts[2])
    # Before anything is made of them: a vertex takes six bytes at least, a face two.
    if 6 * vertex_count + 2 * face_count > len(text) + 1:
        raise UnreadableError(_CUT_OFF)
    lines = (line.split() for line in text[counts.end() :].splitlines() if line.strip())
    vertices = _vertices(lines, vertex_count)
    # Faces differ in length, so they are read one by one.
    polygons = [_corners(line) for line in islice(lines, face_count)]
    if len(vertices) < vertex_count or len(polygons) < face_count or not polygons:
        raise UnreadableError(_CUT_OFF)
    sizes = np.array([len(polygon) for polygon in polygons])
    try:
        corners = np.array(list(chain.from_iterable(polygons)), dtype=np.int64)
    except OverflowError as error:
        raise UnreadableError(_NO_FACE) from error
    extras = header[1].decode()
    unsupported = {
        f"values that {extras}OFF adds to vertices": vertex_count if extras else 0,
        SIDES: int((sizes < 3).sum()),
    }
    return IndexedTriangles(
        vertices,
        fans(sizes, corners),
        split=int(np.maximum(sizes - 3, 0).sum()),
        unsupported={name: count for name, count in unsupported.items() if count},
    )


def write_off(mesh_file: IndexedTriangles) -> bytes:
    """Write the file's bytes."""
    text = io.StringIO()
    text.write(f"OFF\n{len(mesh_file.vertices)} {len(mesh_file.faces)} 0\n")
    np.savetxt(text, mesh_file.vertices, fmt=f"{NUMBER} {NUMBER} {NUMBER}")
    np.savetxt(text, mesh_file.faces, fmt="3 %d %d %d")
    return text.getvalue().encode()


def _vertices(lines: Iterator[list[bytes]], count: int) -> Float[np.ndarray, "V 3"]:
    """Read so many vertices, or those that there are, some at a time: words are far larger."""
    blocks = [np.zeros((0, 3))]
    for begin in range(0, count, BLOCK):
        rows = [line[:3] for line in islice(lines, min(BLOCK, count - begin))]
        try:
            blocks.append(reals(rows).reshape(-1, 3))
        except ValueError as error:
            raise UnreadableError("the OFF file has a vertex that is not three numbers") from error
    return np.concatenate(blocks)


def _corners(line: list[bytes]) -> list[int]:
    try:
        count = whole(line[0])
        corners = [whole(word) for word in line[1 : 1 + max(count, 0)]]
    except ValueError as error:
        raise UnreadableError(_NO_FACE) from error
    if len(corners) != count:
        raise UnreadableError(_NO_FACE)
    return corners
