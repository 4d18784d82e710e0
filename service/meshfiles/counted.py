"""How many triangles a mesh file will give, counted without reading it."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from jaxtyping import Int, UInt8

from .obj_text import with_line_feeds
from .ply.header import ply_header
from .text_pieces import COMMENT, pieces_from_end, without

# Of what tells no counts, and will hardly be read.
BYTES_PER_FACE = 30
# A face of an STL as text: a normal, three vertices, and the words that name and enclose them.
WORDS_PER_STL_FACE = 21
STL_HEADER, STL_FACE = 84, 50

# Nothing that was passed over is tried again: to remember it would take a hundred times its size.
_OFF_COUNTS = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*+(?:ST)?C?N?OFF\b(?:\s++|#[^\n]*+\n)*+\d{1,18}\s++(\d{1,18})\b"
)
_LINE_END, _SPACE, _FACE = b"\n f"
# The letter f; a polygon's count of corners. Each corner beyond the second makes a triangle.
_WORDS_BESIDE_TRIANGLES = 3


def count_triangles(data: bytes, kind: str) -> int:
    """Return about how many triangles a mesh file's polygons make.

    Text is counted by the words of its lines, binary files by the bytes of their faces: polygons of
    many corners share vertices, and their triangles take a few bytes each. Others go by their size.
    """
    if kind == "obj":
        # A line that goes on in the next is one; of the same length, nothing is moved.
        text = without(COMMENT, with_line_feeds(data))
        text = text.replace(b"\\\n", b"  ").replace(b"\\\r\n", b"   ")
        pieces = map(_lines, pieces_from_end(text))
        return sum(_triangles(piece.words[piece.firsts == _FACE]) for piece in pieces)
    if kind == "stl":
        return _of_stl(data)
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


def is_binary_stl(data: bytes) -> bool:
    """Return whether the count of faces agrees with the length: text may begin in any way."""
    return len(data) == STL_HEADER + STL_FACE * int.from_bytes(data[80:STL_HEADER], "little")


def _of_stl(data: bytes) -> int:
    if is_binary_stl(data):
        return (len(data) - STL_HEADER) // STL_FACE
    words = sum(int(piece.words.sum()) for piece in map(_lines, pieces_from_end(data)))
    return words // WORDS_PER_STL_FACE


def _by_size(data: bytes) -> int:
    return len(data) // BYTES_PER_FACE


def _in_last_lines(data: bytes, polygons: int) -> int:
    """Count the triangles of so many polygons, which come last."""
    triangles, left = 0, polygons
    for piece in map(_lines, pieces_from_end(data)):
        words = piece.words[max(len(piece.words) - left, 0) :]
        triangles += _triangles(words)
        left -= len(words)
        if left == 0:
            break
    return triangles


def _triangles(words: Int[np.ndarray, " L"]) -> int:
    return int(np.maximum(words - _WORDS_BESIDE_TRIANGLES, 0).sum())


class _Lines(NamedTuple):
    """Lines with words in them: how many each has, and the letter that the first begins with."""

    words: Int[np.ndarray, " L"]
    firsts: UInt8[np.ndarray, " L"]


def _lines(text: bytes) -> _Lines:
    letters = np.frombuffer(text, dtype=np.uint8)
    if not len(letters):
        return _Lines(np.zeros(0, dtype=np.int64), letters)
    begins = letters > _SPACE
    begins[1:] &= letters[:-1] <= _SPACE
    lines = np.append(0, np.flatnonzero(letters[:-1] == _LINE_END) + 1)
    if len(lines) == 1:
        # Long perhaps: neither a number for each letter nor one for each word.
        words = np.array([np.count_nonzero(begins)])
        return _Lines(words[words > 0], letters[[int(begins.argmax())]][words > 0])
    words = np.add.reduceat(begins, lines, dtype=np.int64)
    places = np.flatnonzero(begins)
    firsts = letters[places[np.searchsorted(places, lines[words > 0])]]
    return _Lines(words[words > 0], firsts)
