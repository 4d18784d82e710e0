"""Text PLY whose polygons have texture coordinates at their corners, cut into triangles.

trimesh reads such coordinates of triangles alone.
"""

from __future__ import annotations

import io

import numpy as np
from jaxtyping import Float, Int

from ...errors import UnreadableError
from ..fans import fans
from ..text_numbers import reals, whole
from .header import POLYGON, Element, PlyHeader

# Two numbers for each of a face's corners.
CORNER_UV = "texcoord"


def of_textured_triangles(data: bytes, header: PlyHeader) -> tuple[bytes, int | None]:
    """Return a text PLY that trimesh reads, and how many polygons became its triangles.

    None: it is the same file. What faces hold beside corners and their texture coordinates is 0 in
    the other, as in a binary one.

    Raises:
        UnreadableError: it ends before its last face, or a face is not what the header says.
    """
    names = [element.name for element in header.elements]
    if "face" not in names:
        return data, None
    at = names.index("face")
    faces = header.elements[at]
    lists = [one.name for one in faces.properties if one.count_kind is not None]
    if len(lists) != 2 or CORNER_UV not in lists or POLYGON.isdisjoint(lists):
        return data, None
    lines = [line for line in data[header.end :].splitlines(keepends=True) if line.strip()]
    begin = sum(element.rows for element in header.elements[:at])
    rows = lines[begin : begin + faces.rows]
    if len(rows) < faces.rows:
        raise UnreadableError(f"the PLY file says {faces.rows} faces and ends after {len(rows)}")
    sizes, corners, uv = _polygons(rows, faces)
    if (sizes == 3).all():
        return data, None
    places = fans(sizes, np.arange(len(corners)))
    head = b"\n".join(
        b"element face %d" % len(places) if line.split()[:2] == [b"element", b"face"] else line
        for line in data[: header.end].splitlines()
    )
    cut = _rows(faces, corners[places], uv[places].reshape(-1, 6))
    behind = lines[begin + faces.rows :]
    return b"".join([head, b"\n", *lines[:begin], cut, *behind]), faces.rows


def _polygons(
    rows: list[bytes], faces: Element
) -> tuple[Int[np.ndarray, " F"], Int[np.ndarray, " C"], Float[np.ndarray, "C 2"]]:
    """Return how many corners each polygon has, and all corners and their coordinates in a row."""
    sizes: list[int] = []
    corners: list[int] = []
    uv: list[bytes] = []
    # One by one: where a number stands hangs on the lists before it.
    for face, row in enumerate(rows):
        words, at, counts = row.split(), 0, dict[str, int]()
        try:
            for one in faces.properties:
                at += 1
                if one.count_kind is not None:
                    count = counts[one.name] = whole(words[at - 1])
                    listed = words[at : at + count]
                    at += count
                    if one.name == CORNER_UV:
                        uv.extend(listed)
                    else:
                        corners.extend(map(whole, listed))
        except (IndexError, ValueError) as error:
            raise _fault(face) from error
        size = next(counts[name] for name in counts if name != CORNER_UV)
        if at > len(words) or size < 0 or counts[CORNER_UV] != 2 * size:
            raise _fault(face)
        sizes.append(size)
    try:
        numbers = np.array(corners, dtype=np.int64), reals([uv])
    except (OverflowError, ValueError) as error:
        raise UnreadableError("the PLY file has a face with what is no number") from error
    return np.array(sizes, dtype=np.int64), numbers[0], numbers[1].reshape(-1, 2)


def _rows(faces: Element, corners: Int[np.ndarray, "T 3"], uv: Float[np.ndarray, "T 6"]) -> bytes:
    """Return triangles as lines of text, with the properties that the header names."""
    columns: list[np.ndarray] = []
    for one in faces.properties:
        if one.count_kind is None:
            columns.append(np.zeros(len(corners)))
            continue
        values = uv if one.name == CORNER_UV else corners
        columns.extend([np.full(len(corners), values.shape[1]), *values.T])
    text = io.StringIO()
    np.savetxt(text, np.stack(columns, axis=1), fmt="%.17g")
    return text.getvalue().encode()


def _fault(face: int) -> UnreadableError:
    return UnreadableError(
        f"face {face} of the PLY file is not its corners and two texture coordinates for each"
    )
