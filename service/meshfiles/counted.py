"""How many triangles a mesh file will give, counted without reading it."""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Int

# Of what is not counted a PLY's face takes about as many bytes; an STL's takes 50, more as text.
BYTES_PER_FACE = 30

_CONTINUED = re.compile(rb"\\\r?\n")
_OFF_COUNTS = re.compile(rb"\s*(?:ST)?C?N?OFF\b(?:\s|#[^\n]*\n)*\d{1,18}\s+(\d{1,18})\b")
_PLY_FACES = re.compile(
    rb"ply\s+format ascii\b.*?^element face (\d{1,18})\s", re.DOTALL | re.MULTILINE
)
_LINE_END, _SPACE, _FACE = b"\n f"
# The letter f; a polygon's count of corners. Each corner beyond the second makes a triangle.
_WORDS_BESIDE_TRIANGLES = 3
# A PLY's header, which may be a whole file of comments, is looked for in so many bytes.
_PLY_HEADER = 2**16


def count_triangles(data: bytes, kind: str) -> int:
    """Return about how many triangles a mesh file's polygons make.

    An OBJ's, an OFF's and a text PLY's are counted by the words of its lines: polygons of many
    corners share vertices, and their triangles take a few bytes each. Others go by their size.
    """
    if kind == "obj":
        text = _CONTINUED.sub(b" ", data) if b"\\" in data else data
        return _triangles(_words_by_line(text, first=_FACE))
    counted = None
    if kind == "off":
        counted = _OFF_COUNTS.match(data)
    elif kind == "ply":
        counted = _PLY_FACES.match(data[:_PLY_HEADER])
    if counted is None:
        return len(data) // BYTES_PER_FACE
    words = _words_by_line(data)
    words = words[words > 0]
    # Polygons come last.
    return _triangles(words[len(words) - min(int(counted[1]), len(words)) :])


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
