"""OBJ text as trimesh reads it, which takes the usual way of writing for the only one.

It counts an index below 0 from the end of the file and not from its own line, takes 0 for the first
vertex, lines that begin with a blank for none, and a hexagon for a triangle where other faces have
as many numbers. None of that is told: the shape is another one. So such files are written anew.
"""

from __future__ import annotations

import io
import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

from ..errors import UnreadableError
from .text_numbers import reals, whole

_N = rb"[1-9]\d*+"
# All corners of a face in one of these ways; another face is none of the same.
_WAYS = [
    rb"(?: ++" + corner + rb")++ *+(?=\r?\n)"
    for corner in (_N, _N + rb"/" + _N, _N + rb"//" + _N, _N + rb"/" + _N + rb"/" + _N)
]
_FACE = re.compile(rb"\nf(?= )")
_OTHER_FACES = [(re.compile(way), re.compile(rb"\nf(?= )(?!" + way + rb")")) for way in _WAYS]
_OTHER_LINE = re.compile(rb"\n(?:[ \t]++(?:v|vt|f)[ \t]|(?:v|vt|f)\t|vt? [^\n#]*+#)")
_CONTINUED = re.compile(rb"\\\r?\n")
# As some programs ended lines before 2001.
_ENDED_BY_RETURN = re.compile(rb"[^\r\n]*\r(?!\n)")


def line_end(start: bytes) -> bytes:
    """Return what ends the first line of a text: a carriage return alone, or a line feed."""
    return b"\r" if _ENDED_BY_RETURN.match(start) else b"\n"


def with_line_feeds(text: bytes) -> bytes:
    """Return a text whose lines end with line feeds; the same bytes where its first one does."""
    return text if line_end(text) == b"\n" else text.replace(b"\r", b"\n")


def usual_obj(data: bytes) -> bytes:
    """Return an OBJ that trimesh reads as it is meant: the same bytes where it does so anyway.

    Raises:
        UnreadableError: a file to be written anew has a line that cannot be understood.
    """
    text = data.removeprefix(BOM_UTF8)
    return text if _is_usual(b"\n%b\n" % text) else written_anew(text)


def _is_usual(lines: bytes) -> bool:
    if _CONTINUED.search(lines) or _OTHER_LINE.search(lines):
        return False
    face = _FACE.search(lines)
    if face is None:
        return True
    return any(
        way.match(lines, face.end()) and not other.search(lines) for way, other in _OTHER_FACES
    )


@dataclass
class _Counts:
    """How many positions and texture coordinates there are, so far or in all."""

    v: int = 0
    vt: int = 0


def written_anew(text: bytes) -> bytes:
    """Return positions, texture coordinates, and faces of three corners or more, line by line.

    Texture coordinates stay where all corners have them: half of them are not interpolated.

    Raises:
        UnreadableError: a line cannot be understood; it is named by its number.
    """
    total = _Counts()
    for _, keyword, _ in _statements(text):
        total.v += keyword == b"v"
        total.vt += keyword == b"vt"
    so_far, textured = _Counts(), True
    # Faces with texture coordinates, and without: which it is to be is known at the end.
    full, bare = bytearray(), bytearray()
    for number, keyword, rest in _statements(text):
        plain = None
        match keyword:
            case b"v":
                so_far.v += 1
                line = b"v " + _position(number, rest)
            case b"vt":
                so_far.vt += 1
                line = b"vt " + _first_three(rest)
            case b"f" if len(words := rest.split()) > 2:
                corners = [_corner(number, word, so_far, total) for word in words]
                textured = textured and all(vt > 0 for _, vt in corners)
                line = b"f" + b"".join(b" %d/%d" % corner for corner in corners)
                plain = b"f" + b"".join(b" %d" % v for v, _ in corners)
            case _:
                continue
        bare += b"%b\n" % (line if plain is None else plain)
        if textured:
            full += b"%b\n" % line
    return bytes(full if textured else bare)


def _statements(text: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield the number of each statement's first line, its keyword, and its rest but comments."""
    begun: list[bytes] = []
    # Line by line: of a list of all of them short ones take many times the file. One more ends a
    # statement that the last one leaves open.
    for number, ended in enumerate(chain(io.BytesIO(text), [b""]), start=1):
        line = ended.rstrip(b"\r\n")
        # A comment ends with its line, even one that names a folder.
        if line.endswith(b"\\") and b"#" not in line:
            begun.append(line[:-1])
            continue
        words = b" ".join([*begun, line]).partition(b"#")[0].split(maxsplit=1)
        if words:
            yield number - len(begun), words[0], words[1] if len(words) > 1 else b""
        begun.clear()


def _first_three(rest: bytes) -> bytes:
    """Return the first three words."""
    return b" ".join(rest.split(maxsplit=3)[:3])


def _position(number: int, rest: bytes) -> bytes:
    words = _first_three(rest).split()
    try:
        reals([words])
    except ValueError as error:
        raise _fault(number, "a coordinate is no number") from error
    if len(words) < 3:
        raise _fault(number, f"a vertex has {len(words)} coordinates")
    return b" ".join(words)


def _corner(number: int, word: bytes, so_far: _Counts, total: _Counts) -> tuple[int, int]:
    """Return which vertex, and which texture coordinates, a corner names; 0: none there are."""
    vertex, _, others = word.partition(b"/")
    try:
        v, vt = whole(vertex), whole(others.partition(b"/")[0] or b"0")
    except ValueError as error:
        raise _fault(number, "a corner of a face is no number") from error
    if v == 0:
        raise _fault(number, "a face names vertex 0, and they count from 1")
    if not 1 <= (from_start := v if v > 0 else so_far.v + 1 + v) <= total.v:
        raise _fault(
            number, f"a face names vertex {v}, and there are {total.v if v > 0 else so_far.v}"
        )
    texture = vt if vt >= 0 else so_far.vt + 1 + vt
    return from_start, texture if 1 <= texture <= total.vt else 0


def _fault(number: int, what: str) -> UnreadableError:
    return UnreadableError(f"line {number} of the OBJ file: {what}")
