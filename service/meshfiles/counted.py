"""How many triangles a mesh file will give, counted without reading it."""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Int

from .obj_text import with_line_feeds
from .ply.header import ply_header

# Of what is not counted an STL's face takes 50 bytes, more as text.
BYTES_PER_FACE = 30

_CONTINUED = re.compile(rb"\\\r?\n")
_COMMENT = re.compile(rb"#[^\n]*")
_INDENTED = re.compile(rb"^[ \t]+(?=f)", re.MULTILINE)
_OFF_COUNTS = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*(?:ST)?C?N?OFF\b(?:\s|#[^\n]*\n)*\d{1,18}\s+(\d{1,18})\b"
)
_LINE_END, _SPACE, _FACE = b"\n f"
# The letter f; a polygon's count of corners. Each corner beyond the second makes a triangle.
_WORDS_BESIDE_TRIANGLES = 3


def count_triangles(data: bytes, kind: str) -> int:
    """Return about how many triangles a mesh file's polygons make.

    Text is counted by the words of its lines, a binary PLY by the bytes of its faces: polygons of
    many corners share vertices, and their triangles take a few bytes each. Others go by their size.
    """
    if kind == "obj":
        text = with_line_feeds(data)
        text = _CONTINUED.sub(b" ", text) if b"\\" in text else text
        text = _COMMENT.sub(b"", text) if b"#" in text else text
        return _triangles(_words_by_line(_INDENTED.sub(b"", text), first=_FACE))
    if kind == "off":
        counts = _OFF_COUNTS.match(data)
        return _by_size(data) if counts is None else _in_last_lines(data, int(counts[1]))
    header = ply_header(data) if kind == "ply" else None
    faces = None if header is None else header.faces_at()
    places = None if faces is None else faces[0].polygons()
    if header is None or faces is None or places is None:
        return _by_size(data)
    (element, begin), (before, polygon, behind) = faces, places
    if header.order is None:
        return _in_last_lines(data, element.rows)
    beside = before + np.dtype(polygon.count_kind).itemsize + behind
    corners = (len(data) - begin - element.rows * beside) // polygon.size
    return max(corners - 2 * element.rows, 0)


def _by_size(data: bytes) -> int:
    return len(data) // BYTES_PER_FACE


def _in_last_lines(data: bytes, polygons: int) -> int:
    """Count the triangles of so many polygons, which come last."""
    words = _words_by_line(data)
    words = words[words > 0]
    return _triangles(words[len(words) - min(polygons, len(words)) :])


def _triangles(words: Int[np.ndarray, " L"]) -> int:
    return int(np.maximum(words - _WORDS_BESIDE_TRIANGLES, 0).sum())


def _words_by_line(text: bytes, first: int | None = None) -> Int[np.ndarray, " L"]:
    """Count the words of each line, or of those alone that begin with a letter."""
    letters = np.frombuffer(text, dtype=np.uint8)
    if not len(letters):
        return np.zeros(0, dtype=np.int64)
    begins = letters > _SPACE
    begins[1:] &= letters[:-1] <= _SPACE
    lines = np.append(0, np.flatnonzero(letters[:-1] == _LINE_END) + 1)
    words = np.add.reduceat(begins, lines, dtype=np.int64)
    return words if first is None else words[letters[lines] == first]
