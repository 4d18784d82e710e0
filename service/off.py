"""The Object File Format: text, faces with any number of corners.

trimesh 5 stops at faces with more than four corners, and those are what OFF files are used for.
"""

from __future__ import annotations

import io
import re
from itertools import islice, pairwise

import numpy as np

from service.errors import UnreadableError
from service.soup import NUMBER, TriangleSoup

_COMMENT = re.compile(rb"#[^\n]*")
_HEADER = re.compile(rb"\s*((?:ST)?C?N?)OFF\b")
_COUNTS = re.compile(rb"\s*(\d+)\s+(\d+)(?:[ \t]+\d+)?[ \t]*\r?\n")


def read_off(data: bytes) -> TriangleSoup:
    """Positions and faces, polygons split into fans; colours and normals are passed over.

    Raises:
        UnreadableError: not a text OFF file, or one without faces.
    """
    text = _COMMENT.sub(b"", data)
    header = _HEADER.match(text)
    counts = _COUNTS.match(text, header.end() if header else 0)
    if header is None or counts is None:
        raise UnreadableError("this is not a readable OFF file: no header")
    lines = (line.split() for line in text[counts.end() :].splitlines() if line.strip())
    vertex_count, face_count = int(counts[1]), int(counts[2])
    try:
        vertices = np.array([line[:3] for line in islice(lines, vertex_count)], dtype=np.float64)
        # Faces differ in length, so they are read one by one.
        polygons = [_corners(line) for line in islice(lines, face_count)]
    except ValueError as error:
        raise UnreadableError(f"this is not a readable OFF file: {error}") from error
    if len(vertices) < vertex_count or len(polygons) < face_count or not polygons:
        raise UnreadableError("the OFF file ends before its last face, or has none")
    faces = np.array(
        [
            (polygon[0], second, third)
            for polygon in polygons
            for second, third in pairwise(polygon[1:])
        ],
        dtype=np.int64,
    ).reshape(-1, 3)
    extras = header[1].decode()
    left_out = {f"values that {extras}OFF adds to vertices": vertex_count} if extras else {}
    return TriangleSoup(vertices, faces, split=max(0, len(faces) - face_count), left_out=left_out)


def write_off(soup: TriangleSoup) -> bytes:
    """The file's bytes."""
    text = io.StringIO()
    text.write(f"OFF\n{len(soup.vertices)} {len(soup.faces)} 0\n")
    np.savetxt(text, soup.vertices, fmt=f"{NUMBER} {NUMBER} {NUMBER}")
    np.savetxt(text, soup.faces, fmt="3 %d %d %d")
    return text.getvalue().encode()


def _corners(line: list[bytes]) -> list[int]:
    count = int(line[0])
    corners = [int(word) for word in line[1 : 1 + count]]
    if len(corners) < count:
        raise ValueError("a face has fewer corners than it says")
    return corners
