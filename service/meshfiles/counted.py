"""Count the triangles that a mesh file will give, without reading its numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Int, UInt8

from ..errors import UnreadableError
from . import off, stl
from .ply import POLYGON, ply_header
from .text import count_words, plain_letters, plain_text

# Of what tells no counts, and will hardly be read.
BYTES_PER_FACE = 30
# What is cut into words in one go, which takes many times its size.
PIECE = 2**18
# Each corner beyond the second makes a triangle; a keyword or a count stands before them.
_WORDS_BESIDE_TRIANGLES = 3
# Where counts are looked for, and how far lines are looked for that go on.
START = 2**20


def count_triangles(data: bytes, kind: str) -> int:
    """Return about how many triangles a mesh file's polygons make.

    Text is counted by the words of its lines, binary files by the bytes of their faces: polygons of
    many corners share vertices, and their triangles take a few bytes each.
    """
    if kind == "stl":
        text = stl.is_text(data)
        return count_words(data) // stl.WORDS_PER_FACET if text else stl.count_facets(data)
    if kind == "ply":
        return _of_ply(data)
    text = plain_text(data)
    if kind == "obj":
        return sum(_triangles(words[firsts | 32 == ord("f")]) for words, firsts in _lines(text))
    start = plain_letters(text[:START], continued=False)[0].tobytes()
    header = off.HEADER.match(start)
    numbers = start[header.end() :].split(maxsplit=2)[:2] if header else []
    if len(numbers) == 2 and numbers[1].isdigit():
        return _in_last_lines(text, int(numbers[1]))
    return len(data) // BYTES_PER_FACE


def _of_ply(data: bytes) -> int:
    """Count by the header: in text the lines of faces come last, else by their bytes."""
    try:
        header = ply_header(data)
    except UnreadableError:
        return len(data) // BYTES_PER_FACE
    faces = next((element for element in header.elements if element.name == "face"), None)
    polygon = next((p for p in faces.properties if p.name in POLYGON), None) if faces else None
    if faces is None or polygon is None or polygon.count_kind is None:
        # Strips: an index makes a triangle.
        return (len(data) - header.end) // 4
    if header.order is None:
        return _in_last_lines(plain_text(data[header.end :]), faces.rows)
    beside = sum(int((p.count_kind or p.kind)[1]) for p in faces.properties)
    others = sum(
        e.rows * sum(int(p.kind[1]) for p in e.properties)
        for e in header.elements
        if e is not faces and not any(p.count_kind for p in e.properties)
    )
    left = len(data) - header.end - others - faces.rows * beside
    return max(left // int(polygon.kind[1]) - 2 * faces.rows, 0)


def _lines(text: bytes) -> Iterator[tuple[Int[np.ndarray, " L"], UInt8[np.ndarray, " L"]]]:
    """Yield how many words lines have, and their first letters, some lines at a time, last first.

    Lines without words are left out; those that go on in the next are one.
    """
    end = len(text)
    while end:
        begin = text.rfind(b"\n", 0, max(end - PIECE, 0)) + 1
        while text[begin - 2 : begin] == b"\\\n" and end - begin < START:
            begin = text.rfind(b"\n", 0, begin - 1) + 1
        letters, ends = plain_letters(text[begin:end], continued=True)
        begins = letters > ord(" ")
        begins[1:] &= letters[:-1] <= ord(" ")
        starts = np.append(0, ends + 1)
        starts = starts[starts < len(letters)]
        end = begin
        if len(starts) <= 1:
            # Long perhaps: no place of each word.
            words = np.array([np.count_nonzero(begins)])
            firsts = letters[[int(begins.argmax())]] if len(letters) else letters
            yield words[words > 0], firsts[: int(words[0] > 0)]
            continue
        words = np.add.reduceat(begins, starts, dtype=np.int64)
        words = words[words > 0]
        yield words, letters[np.flatnonzero(begins)[np.cumsum(words) - words]]


def _in_last_lines(text: bytes, polygons: int) -> int:
    """Count the triangles of so many polygons, which come last."""
    triangles, left = 0, polygons
    for words, _ in _lines(text):
        words = words[-left:]
        triangles += _triangles(words)
        left -= len(words)
        if left <= 0:
            break
    return triangles


def _triangles(words: Int[np.ndarray, " L"]) -> int:
    return int(np.maximum(words - _WORDS_BESIDE_TRIANGLES, 0).sum())
