"""Mesh files larger than memory, block by block: the triangles that they list, as they list them.

A reader gives vertices and faces to a sink as they come. Faces must be triangles: a polygon is
refused, and `pns subdivide` splits it where the file fits into memory.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import UnreadableError
from ...meshfiles.ply import LONGEST, POLYGON, Element, PlyHeader, ply_header
from .arrays import blocks_of
from .passed_over import of_obj, of_ply
from .sink import Sink

# Bytes of text that are read at a time.
TEXT = 1 << 24

_OBJ_VERTEX = re.compile(rb"^[ \t]*v(?=[ \t])" + 3 * rb"(?:[ \t]+([^\s#]+))?", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]+([^\r\n#]*)", re.MULTILINE)
_ENDED_BY_RETURN = re.compile(rb"[^\r\n]*\r(?!\n)")
_STL_FACE = re.compile(
    rb"outer\s+loop" + 3 * rb"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)" + rb"\s+endloop", re.IGNORECASE
)


def read_ply(path: Path, sink: Sink) -> None:
    """Read a binary PLY of triangles, of either byte order.

    Raises:
        UnreadableError: another file, or a face that is no triangle.
    """
    header = _ply_header(path)
    sink.passed_over.update(of_ply(header))
    start = header.end
    for element in header.elements:
        name, count, kind = element.name, element.rows, _ply_record(path, header, element)
        if path.stat().st_size < start + count * kind.itemsize:
            raise UnreadableError(f"{path}: it ends within its {name} elements")
        if count and name in ("vertex", "face"):
            records = np.memmap(path, kind, "r", start, (count,))
            for rows in blocks_of(count):
                if name == "vertex":
                    axes = [records[axis][rows] for axis in "xyz"]
                    sink.add_vertices(np.stack(axes, axis=1))
                else:
                    _add_triangles(path, records[rows], rows.start, sink)
        start += count * kind.itemsize


def _add_triangles(path: Path, records: np.ndarray, first: int, sink: Sink) -> None:
    sizes = records["count"]
    if (sizes != 3).any():
        worst = int(np.argmax(sizes != 3))
        raise UnreadableError(
            f"{path}: face {first + worst} has {sizes[worst]} corners; only triangles are read"
        )
    sink.add_faces(records["corners"])


def _ply_header(path: Path) -> PlyHeader:
    with path.open("rb") as file:
        head = file.read(LONGEST)
    try:
        header = ply_header(head)
    except UnreadableError as error:
        raise UnreadableError(f"{path}: {error}") from error
    if header.order is None:
        raise UnreadableError(f"{path}: only a binary PLY is read")
    if {"vertex", "face"} - {element.name for element in header.elements}:
        raise UnreadableError(f"{path}: the PLY file has no vertices or no faces")
    return header


def _ply_record(path: Path, header: PlyHeader, element: Element) -> np.dtype:
    """Return the record of an element, whose lists are of triangles' corners."""
    fields: list[Any] = []
    for one in element.properties:
        kind = f"{header.order}{one.kind}"
        if one.count_kind is None:
            fields.append((one.name, kind))
        elif one.name in POLYGON and element.name == "face":
            fields.append(("count", f"{header.order}{one.count_kind}"))
            fields.append(("corners", kind, (3,)))
        else:
            raise UnreadableError(f"{path}: the list '{one.name}' of {element.name} is not read")
    try:
        kind = np.dtype(fields)
    except ValueError as error:  # a name that is there twice
        raise UnreadableError(f"{path}: the PLY header's {element.name} cannot be read") from error
    needed = {"vertex": {"x", "y", "z"}, "face": {"corners"}}.get(element.name, set())
    if needed - set(kind.names or ()):
        raise UnreadableError(f"{path}: the PLY file's {element.name} has no {sorted(needed)}")
    return kind


def read_stl(path: Path, sink: Sink) -> None:
    """Read an STL, binary or text: three vertices of their own for each face.

    Raises:
        UnreadableError: another file.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:84], "little") if len(head) == 84 else -1
    if size == 84 + 50 * count:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        records = np.memmap(path, kind, "r", 84, (count,)) if count else np.zeros(0, kind)
        for rows in blocks_of(count):
            _add_soup(sink, np.array(records["corners"][rows]).reshape(-1, 3))
            if coloured := int(np.count_nonzero(records["rest"][rows])):
                sink.passed_over["colours of faces"] += coloured
        return
    with path.open("rb") as file:
        start = file.read(TEXT)
    # Some programs write all words in capitals.
    end = b"ENDLOOP" if b"ENDLOOP" in start else b"endloop"
    if end not in start:
        raise UnreadableError(f"{path}: it has no faces as text, and is no whole binary STL")
    text = b""
    for text in _text_blocks(path, end):
        faces = _STL_FACE.findall(text)
        if len(faces) != text.count(end):
            raise UnreadableError(f"{path}: a face is no triangle")
        _add_soup(sink, _numbers(path, faces))
    if b"endsolid" not in text.lower():
        raise UnreadableError(f"{path}: the STL file ends within a solid")


def _add_soup(sink: Sink, points: np.ndarray) -> None:
    first = sink.vertices
    sink.add_vertices(points)
    sink.add_faces(np.arange(first, first + len(points)).reshape(-1, 3))


def read_obj(path: Path, sink: Sink) -> None:
    """Read an OBJ's positions and triangles; all else is passed over, and counted.

    Raises:
        UnreadableError: a number that is none, or a face that is no triangle.
    """
    with path.open("rb") as file:
        # As some programs ended lines before 2001.
        end = b"\r" if _ENDED_BY_RETURN.match(file.read(TEXT)) else b"\n"
    for block in _text_blocks(path, end):
        text = block.replace(end, b"\n")
        sink.passed_over.update(of_obj(text))
        before = sink.vertices
        lines = list(_OBJ_VERTEX.finditer(text))
        # One that is missing is NaN, which is refused.
        sink.add_vertices(_numbers(path, [line.groups() for line in lines]))
        starts = np.array([line.start() for line in lines], dtype=np.int64)
        faces = list(_OBJ_FACE.finditer(text))
        corners = _obj_corners(path, [face[1] for face in faces])
        # A number below 0 counts back from the vertices above the face.
        above = before + np.searchsorted(starts, [face.start() for face in faces])
        sink.add_faces(np.where(corners < 0, above[:, None] + corners, corners - 1))


def _obj_corners(path: Path, faces: list[bytes]) -> np.ndarray:
    try:
        rows = [[_whole(corner.partition(b"/")[0]) for corner in face.split()] for face in faces]
    except ValueError as error:
        raise UnreadableError(f"{path}: a corner of a face is no number") from error
    for row in rows:
        if len(row) != 3:
            raise UnreadableError(f"{path}: a face has {len(row)} corners; only triangles are read")
    try:
        return np.array(rows, dtype=np.int64).reshape(-1, 3)
    except OverflowError as error:
        raise UnreadableError(f"{path}: a corner of a face is out of range") from error


def _whole(word: bytes) -> int:
    if b"_" in word:
        raise ValueError("an underscore is no digit")
    return int(word)


def _numbers(path: Path, rows: list[Any]) -> np.ndarray:
    # Python, and numpy with it, takes 1_0 for ten as well.
    if b"_" in b"".join(word for row in rows for word in row if word is not None):
        raise UnreadableError(f"{path}: a coordinate is no number")
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise UnreadableError(f"{path}: a coordinate is no number") from error


def _text_blocks(path: Path, end: bytes) -> Iterator[bytes]:
    """Yield a file's text in blocks that end with `end`; a line that fills one is no mesh's."""
    with path.open("rb") as file:
        left = b""
        if file.read(len(BOM_UTF8)) != BOM_UTF8:
            file.seek(0)
        while block := file.read(TEXT):
            lines, last, rest = (left + block).rpartition(end)
            if len(rest) >= TEXT:
                raise UnreadableError(f"{path}: a line, or a face, of more than {TEXT} bytes")
            yield lines + last
            left = rest
        yield left
