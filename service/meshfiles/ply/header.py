"""What the header of a PLY says: its elements, and where each one's bytes lie."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

# It is text, and a file may be one long comment.
LONGEST = 2**20
POLYGON = frozenset({"vertex_index", "vertex_indices"})

_FORMAT = {b"ascii": None, b"binary_little_endian": "<", b"binary_big_endian": ">"}
_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_BEGIN = re.compile(rb"ply\s+(?:(?:comment|obj_info)[^\n]*\n)*format (\w+) 1\.0\s")
_END = re.compile(rb"^end_header\r?\n", re.MULTILINE)


@dataclass(frozen=True)
class Property:
    """A number of each row, or a list of them; types are numpy's without an order of bytes."""

    name: str
    kind: str
    # Of a list's length; None: one number.
    count_kind: str | None = None

    @property
    def size(self) -> int:
        """Bytes of one number."""
        return int(self.kind[1])


@dataclass
class Element:
    """Rows of the same properties."""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)

    @property
    def row_bytes(self) -> int | None:
        """Bytes of a row; None where it has lists."""
        if any(one.count_kind is not None for one in self.properties):
            return None
        return sum(one.size for one in self.properties)

    def polygons(self) -> tuple[int, Property, int] | None:
        """Return a list of vertices, and the bytes before it and behind it in a row.

        None where there is no such list, or another beside it.
        """
        lists = [one for one in self.properties if one.count_kind is not None]
        if len(lists) != 1 or lists[0].name not in POLYGON or lists[0].kind[0] == "f":
            return None
        at = self.properties.index(lists[0])
        before, behind = self.properties[:at], self.properties[at + 1 :]
        return sum(one.size for one in before), lists[0], sum(one.size for one in behind)


@dataclass(frozen=True)
class PlyHeader:
    """A header.

    Attributes:
        order: of bytes, as numpy writes it; None: the file is text.
        elements: in their order.
        end: where what they hold begins.
    """

    order: str | None
    elements: list[Element]
    end: int

    def faces_at(self) -> tuple[Element, int] | None:
        """Return a binary file's faces and where they begin; None where the header does not say."""
        at = self.end
        for element in self.elements:
            if element.name == "face":
                return element, at
            if element.row_bytes is None:
                return None
            at += element.rows * element.row_bytes
        return None


def ply_header(data: bytes) -> PlyHeader | None:
    """Read the header; None where it is none, or an unusual one."""
    start = data[:LONGEST]
    begin, end = _BEGIN.match(start), _END.search(start)
    if begin is None or end is None or begin[1] not in _FORMAT:
        return None
    elements: list[Element] = []
    for line in start[begin.end() : end.start()].decode("latin-1").splitlines():
        match line.split():
            case ["element", name, rows] if rows.isdecimal() and len(rows) < 19:
                elements.append(Element(name, int(rows)))
            case ["property", "list", count, kind, name] if elements:
                if count not in _TYPES or kind not in _TYPES or _TYPES[count][0] == "f":
                    return None
                elements[-1].properties.append(Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(Property(name, _TYPES[kind]))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                return None
    return PlyHeader(_FORMAT[begin[1]], elements, end.end())
