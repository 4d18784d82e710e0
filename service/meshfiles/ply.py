"""PLY, the Polygon File Format: text or binary, elements and properties as the header says.

plyfile, the library for it, is under the GPL and reads text by lines; trimesh cannot read polygons
of several sizes, strips, or colours of faces, and asks for scipy where there are further elements.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from struct import unpack_from
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped, UInt8

from ..errors import UnreadableError
from .mesh_file import (
    COLOUR,
    NONE,
    NORMAL,
    UV,
    Layer,
    MeshFile,
    colours_of,
    dropped,
    offsets_of,
)
from .text import count_words, cut_text, encoding_of, parsed, plain_text

# It is text, and a file may be one long comment.
LONGEST = 2**20
POLYGON = frozenset({"vertex_index", "vertex_indices"})
STRIPS = "tristrips"
# Two numbers for each of a face's corners.
CORNER_UV = "texcoord"

_ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
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
_NAMES = {kind: name for name, kind in _TYPES.items() if not name[-1].isdigit()}
_END = re.compile(rb"^[ \t]*end_header[ \t]*(?:\r\n|\n|\r)", re.MULTILINE)
_REMARK = re.compile(rb"(?m)^[ \t]*(?:comment|obj_info)\b[^\n]*$")
# Properties of vertices that are one layer, by the names that programs give them.
_LAYERS = {
    NORMAL: (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z")),
    UV: (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t")),
    COLOUR: tuple(
        names[:count]
        for count in (4, 3)
        for names in (
            ("red", "green", "blue", "alpha"),
            ("r", "g", "b", "a"),
            ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
        )
    ),
}


@dataclass(frozen=True)
class Property:
    """A number of each row, or a list of them; types are numpy's without an order of bytes."""

    name: str
    kind: str
    # Of a list's length; None: one number.
    count_kind: str | None = None


@dataclass
class Element:
    """Rows of the same properties."""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """A header.

    Attributes:
        order: of bytes, as numpy writes it; None: the file is text.
        elements: in their order.
        end: where what they hold begins.
        textures: names of images in comments, as MeshLab writes them.
        encoding: of its letters.
    """

    order: str | None
    elements: list[Element]
    end: int
    textures: tuple[str, ...] = ()
    encoding: str = "utf-8"


def ply_header(data: bytes) -> PlyHeader:
    """Read the header. Raises UnreadableError with the line that cannot be understood."""
    start = data[:LONGEST]
    end = _END.search(start.replace(b"\r", b"\n") if b"\n" not in start[:80] else start)
    if not start.startswith(b"ply") or end is None:
        raise UnreadableError("this is not a PLY file, or its header has no end")
    order, elements, textures = "", list[Element](), list[str]()
    text = start[3 : end.start()]
    encoding = encoding_of(text)
    lines = text.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(lines.split("\n"), start=1):
        match line.split():
            case ["format", name, *_] if name in _ORDERS:
                order = name
            case ["element", name, rows] if rows.isdecimal() and len(rows) < 19:
                elements.append(Element(name, int(rows)))
            case ["property", "list", count, kind, name] if (
                elements and kind in _TYPES and _TYPES.get(count, "f")[0] != "f"
            ):
                elements[-1].properties.append(Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(Property(name, _TYPES[kind]))
            case ["comment", "TextureFile", _, *_]:
                textures.append(line.partition("TextureFile")[2].strip())
            case ["format" | "element" | "property", *_]:
                raise UnreadableError(f"line {number} of the PLY header: {line[:60]!r}")
            case _:
                # Comments, and what programs write without that word.
                pass
    if order == "":
        raise UnreadableError("the PLY header names no format that is known")
    return PlyHeader(_ORDERS[order], elements, end.end(), tuple(textures), encoding)


@dataclass(frozen=True, eq=False)
class _List:
    """A property of lists: how long each is, and all of them in a row."""

    sizes: Int[np.ndarray, " N"]
    values: Shaped[np.ndarray, " C"]


_Columns = dict[str, "Shaped[np.ndarray, ' N'] | _List"]


def read_ply(data: bytes) -> MeshFile:
    """Read a PLY: polygons or triangle strips, and what vertices and faces have beside them.

    Raises:
        UnreadableError: not a PLY, one that ends too early, or one whose numbers cannot be read.
    """
    if not data.startswith(b"ply"):
        # A byte-order mark, or wide letters: a text.
        data = plain_text(data).lstrip()
    header = ply_header(data)
    tables = _tables(data, header)
    vertex, vertex_lists = _apart(tables.get("vertex", {}))
    if not {"x", "y", "z"} <= vertex.keys():
        raise UnreadableError("the PLY file has no vertices with x, y and z")
    lost: Counter[str] = Counter()
    for element in header.elements:
        if element.name not in ("vertex", "face", STRIPS):
            lost[f"element {element.name}"] += element.rows
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
    for name, column in vertex_lists.items():
        lost[f"vertex property {name}"] += len(column.sizes)
    face, lists = _apart(tables.get("face", {}))
    polygons = next((lists[name] for name in POLYGON if name in lists), None)
    if polygons is None or not len(polygons.sizes):
        sizes, corners = _of_strips(tables.get(STRIPS, {}))
        face, lists = {}, {}
    else:
        sizes, corners = polygons.sizes, polygons.values.astype(np.int64)
    layers = {name: Layer(values, corners) for name, values in _layers(vertex).items()}
    for name in lists.keys() - POLYGON - {CORNER_UV}:
        lost[f"face property {name}"] += len(sizes)
    corner_uv = lists.get(CORNER_UV)
    if corner_uv is not None:
        if (corner_uv.sizes == 2 * sizes).all():
            values = corner_uv.values.reshape(-1, 2)
            layers[UV] = Layer(values.astype(np.float64), np.arange(len(values)))
        else:
            lost["texture coordinates that not all corners have"] += len(sizes)
    return MeshFile(
        vertices,
        offsets_of(sizes),
        corners,
        layers,
        _face_values(face),
        double=any(
            one.name == "x" and one.kind == "f8"
            for element in header.elements
            for one in element.properties
        ),
        changes=dropped(lost),
        textures=header.textures,
        encoding=header.encoding,
    )


def _apart(columns: _Columns) -> tuple[dict[str, np.ndarray], dict[str, _List]]:
    """Return the numbers of an element's rows, and their lists."""
    numbers = {n: column for n, column in columns.items() if not isinstance(column, _List)}
    return numbers, {n: column for n, column in columns.items() if isinstance(column, _List)}


def _layers(vertex: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what vertices have beside positions."""
    left = {name: column for name, column in vertex.items() if name not in ("x", "y", "z")}
    layers: dict[str, np.ndarray] = {}
    for layer, choices in _LAYERS.items():
        known = (names for names in choices if set(names) <= left.keys())
        alike = layer != COLOUR
        chosen = next((n for n in known if alike or len({left[name].dtype for name in n}) == 1), ())
        if not chosen:
            continue
        values = np.stack([left.pop(name) for name in chosen], axis=1)
        layers[layer] = colours_of(values) if layer == COLOUR else values.astype(np.float64)
    return layers | {f"_{name}": column[:, None] for name, column in left.items()}


def _face_values(face: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what faces have beside their corners."""
    values = {name: column[:, None] for name, column in face.items()}
    names = [name for name in ("red", "green", "blue", "alpha") if name in values]
    if len(names) >= 3 and len({values[name].dtype for name in names}) == 1:
        values[COLOUR] = colours_of(np.hstack([values.pop(name) for name in names]))
    return values


def _of_strips(strips: _Columns) -> tuple[Int[np.ndarray, " F"], Int[np.ndarray, " C"]]:
    """Return the triangles of strips, which −1 divides; every second one turns the other way."""
    found = next((strips[name] for name in POLYGON if isinstance(strips.get(name), _List)), None)
    if not isinstance(found, _List):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    ends = np.cumsum(found.sizes)
    values = np.insert(found.values.astype(np.int64), ends, NONE)
    a, b, c = values[:-2], values[1:-1], values[2:]
    begins = np.where(np.append(True, values[:-1] == NONE), np.arange(len(values)), 0)
    odd = (np.arange(len(a)) - np.maximum.accumulate(begins)[: len(a)]) % 2 == 1
    whole = (a != NONE) & (b != NONE) & (c != NONE) & (a != b) & (b != c) & (c != a)
    triangles = np.where(odd[:, None], np.stack([b, a, c], 1), np.stack([a, b, c], 1))[whole]
    return np.full(len(triangles), 3), triangles.reshape(-1)


def _numbers(data: bytes, header: PlyHeader) -> Float[np.ndarray, " N"]:
    """Read a text: numbers count, wherever its lines end."""
    body = plain_text(data[header.end :])
    if b"comment" in body or b"obj_info" in body:
        body = _REMARK.sub(b"", body)
    numbers = parsed(body)
    if len(numbers) != count_words(body):
        before = plain_text(data[: header.end]).count(b"\n")
        text = cut_text(body, "PLY", before, comments=False)
        numbers = text.numbers(np.arange(len(text.begins)))
    return numbers


def _tables(data: bytes, header: PlyHeader) -> dict[str, _Columns]:
    """Read the elements; a text is read as a binary file of doubles."""
    at, text = header.end, header.order is None
    if text:
        data, at = _numbers(data, header).tobytes(), 0

    def dtype_of(kind: str) -> np.dtype:
        return np.dtype("f8" if text else f"{header.order}{kind}")

    tables: dict[str, _Columns] = {}
    for element in header.elements:
        stored = [
            (None if own.count_kind is None else dtype_of(own.count_kind), dtype_of(own.kind))
            for own in element.properties
        ]
        columns, at = _columns(element, stored, data, at)
        table = tables[element.name] = _Columns()
        for own, column in zip(element.properties, columns, strict=True):
            values = _typed(column.values, own) if text else column.values.astype(own.kind)
            table[own.name] = values if own.count_kind is None else _List(column.sizes, values)
    return tables


_Stored = list[tuple["np.dtype | None", np.dtype]]


def _columns(element: Element, stored: _Stored, data: bytes, at: int) -> tuple[list[_List], int]:
    """Read each property of the rows from a place on; return also where they end."""
    first = _row(stored, data, at) if element.rows else [(at, 0) for _ in stored]
    if first is None:
        raise _too_short(element, 0)
    # Where all lists are as long as the first row's, all rows are alike.
    fields: list[Any] = []
    for number, ((count, kind), (_, size)) in enumerate(zip(stored, first, strict=True)):
        fields += [] if count is None else [(f"n{number}", count)]
        fields.append((f"v{number}", kind, (size,)))
    record = np.dtype(fields)
    end = at + element.rows * record.itemsize
    if end <= len(data):
        table = np.ndarray(element.rows if stored else 0, record, data, at)
        sizes = [np.full(len(table), size) for _, size in first]
        if all(
            (table[f"n{number}"] == sizes[number]).all()
            for number, (count, _) in enumerate(stored)
            if count is not None
        ):
            values = [table[f"v{number}"].reshape(-1) for number in range(len(stored))]
            return [_List(*own) for own in zip(sizes, values, strict=True)], end
    begins: list[list[int]] = [[] for _ in stored]
    lengths: list[list[int]] = [[] for _ in stored]
    # One by one: each row begins where another ends.
    for row in range(element.rows):
        found = _row(stored, data, at)
        if found is None:
            raise _too_short(element, row)
        for number, (begin, size) in enumerate(found):
            begins[number].append(begin)
            lengths[number].append(size)
        at = found[-1][0] + found[-1][1] * stored[-1][1].itemsize
    return [
        _gathered(data, kind, np.array(begin), np.array(size))
        for (_, kind), begin, size in zip(stored, begins, lengths, strict=True)
    ], at


def _row(stored: _Stored, data: bytes, at: int) -> list[tuple[int, int]] | None:
    """Return where the numbers of each property of a row begin, and how many; None if cut off."""
    found: list[tuple[int, int]] = []
    for count, kind in stored:
        size = 1
        if count is not None:
            if at + count.itemsize > len(data):
                return None
            (size,) = unpack_from(f"{count.str[0]}{count.char}".replace("|", "="), data, at)
            if not 0 <= size <= len(data) or size % 1:
                return None
            at += count.itemsize
        found.append((at, int(size)))
        at += int(size) * kind.itemsize
    return found if at <= len(data) else None


def _gathered(
    data: bytes, kind: np.dtype, begins: Int[np.ndarray, " N"], sizes: Int[np.ndarray, " N"]
) -> _List:
    firsts = np.repeat(begins - kind.itemsize * (np.cumsum(sizes) - sizes), sizes)
    places = firsts + kind.itemsize * np.arange(len(firsts))
    letters = np.frombuffer(data, dtype=np.uint8)
    return _List(sizes, letters[places[:, None] + np.arange(kind.itemsize)].reshape(-1).view(kind))


def _typed(values: Shaped[np.ndarray, " N"], own: Property) -> Shaped[np.ndarray, " N"]:
    """Return numbers in the type that the header gives; floats of text stay as they are read."""
    if own.kind[0] == "f":
        return values.astype(np.float64)
    wrong = values[values != np.floor(values)]
    if len(wrong):
        raise UnreadableError(f"{own.name} of the PLY file is {wrong[0]:g}, no whole number")
    bounds = np.iinfo(own.kind)
    return np.clip(values, bounds.min, bounds.max).astype(own.kind)


def _too_short(element: Element, rows: int) -> UnreadableError:
    what = {"vertex": "vertices", "face": "faces"}.get(element.name, f"rows of {element.name}")
    return UnreadableError(f"the PLY file says {element.rows} {what} and ends after {rows}")


def write_ply(mesh: MeshFile) -> bytes:
    """Write a binary PLY; every layer belongs to vertices."""
    real = "f8" if mesh.double else "f4"
    fields: list[tuple[str, str]] = []
    columns: list[np.ndarray] = []

    def add(names: tuple[str, ...], values: np.ndarray, kind: str) -> None:
        fields.extend((name, kind) for name in names)
        columns.extend(values.T)

    add(("x", "y", "z"), mesh.vertices, real)
    for name, layer in mesh.layers.items():
        values = layer.values
        if layer.rows is not mesh.corners:
            values = np.zeros((len(mesh.vertices), values.shape[1]), dtype=values.dtype)
            values[mesh.corners] = layer.values[layer.rows]
        names = _names_of(name, values.shape[1])
        kind = values.dtype.str[1:]
        add(names, values, "f4" if kind == "f8" or kind not in _NAMES else kind)
    vertex = _records(fields, columns, len(mesh.vertices))
    head = ["ply", "format binary_little_endian 1.0"]
    head += [f"comment TextureFile {name}" for name in mesh.textures]
    head += [f"element vertex {len(mesh.vertices)}"]
    head += [f"property {_NAMES[kind]} {name}" for name, kind in fields]
    fields, columns = [], []
    for name, values in mesh.face_values.items():
        add(_names_of(name, values.shape[1]), values, values.dtype.str[1:])
    count = "u1" if mesh.sizes.max(initial=0) < 256 else "i4"
    head += [f"element face {len(mesh.sizes)}", f"property list {_NAMES[count]} int vertex_indices"]
    head += [f"property {_NAMES[kind]} {name}" for name, kind in fields]
    faces = _face_bytes(mesh, count, fields, columns)
    header = "\n".join([*head, "end_header\n"]).encode(mesh.encoding)
    return b"".join([header, vertex.data, faces.data])


def _names_of(layer: str, width: int) -> tuple[str, ...]:
    """Return how a layer's columns are called in a PLY, as Blender and MeshLab call them."""
    known = {
        NORMAL: ("nx", "ny", "nz"),
        UV: ("s", "t"),
        COLOUR: ("red", "green", "blue", "alpha"),
    }
    if layer in known:
        return known[layer][:width]
    name = re.sub(r"\s", "_", layer.removeprefix("_"))
    return (name,) if width == 1 else tuple(f"{name}_{place}" for place in range(width))


def _records(
    fields: list[tuple[str, str]], columns: list[np.ndarray], rows: int
) -> UInt8[np.ndarray, "N B"]:
    """Return rows of columns as the bytes of each."""
    kinds = [(f"c{place}", f"<{kind}") for place, (_, kind) in enumerate(fields)]
    table = np.zeros(rows, dtype=kinds)
    for (name, _), column in zip(kinds, columns, strict=True):
        table[name] = column
    return table.view(np.uint8).reshape(rows, -1)


def _face_bytes(
    mesh: MeshFile, count: str, fields: list[tuple[str, str]], columns: list[np.ndarray]
) -> UInt8[np.ndarray, "..."]:
    """Write polygons: how many corners, the corners, and what faces have beside them."""
    sizes = mesh.sizes
    if (sizes == sizes[0]).all():
        kinds = [("", count), *[("", "i4")] * int(sizes[0]), *fields]
        corners = mesh.corners.reshape(len(sizes), -1)
        return _records(kinds, [sizes, *corners.T, *columns], len(sizes))
    beside = np.dtype(count).itemsize + sum(np.dtype(kind).itemsize for _, kind in fields)
    starts = offsets_of(beside + 4 * sizes)
    content = np.empty(starts[-1], dtype=np.uint8)
    for size in np.unique(sizes).tolist():
        kinds = [("", count), *[("", "i4")] * size, *fields]
        chosen = np.flatnonzero(sizes == size)
        corners = mesh.corners[mesh.offsets[chosen, None] + np.arange(size)]
        rows = [sizes[chosen], *corners.T, *(column[chosen] for column in columns)]
        table = _records(kinds, rows, len(chosen))
        content[starts[chosen, None] + np.arange(table.shape[1])] = table
    return content
