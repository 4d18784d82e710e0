"""PLY, the Polygon File Format: text or binary, elements and properties as the header says.

plyfile, the library for it, is under the GPL and reads text by lines; trimesh cannot read polygons
of several sizes, strips, or colours of faces, and asks for scipy where there are further elements.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Int, Shaped

from ..errors import UnreadableError
from .mesh_file import COLOUR, NONE, NORMAL, UV, Layer, MeshFile, dropped, offsets_of
from .text import count_words, cut_text, parsed, plain_text

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
    """

    order: str | None
    elements: list[Element]
    end: int
    textures: int = 0


def ply_header(data: bytes) -> PlyHeader:
    """Read the header. Raises UnreadableError with the line that cannot be understood."""
    start = data[:LONGEST]
    end = _END.search(start.replace(b"\r", b"\n") if b"\n" not in start[:80] else start)
    if not start.startswith(b"ply") or end is None:
        raise UnreadableError("this is not a PLY file, or its header has no end")
    order, elements, textures = "", list[Element](), 0
    lines = start[3 : end.start()].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
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
            case ["comment", "TextureFile", *_]:
                textures += 1
            case ["format" | "element" | "property", *_]:
                raise UnreadableError(f"line {number} of the PLY header: {line[:60]!r}")
            case _:
                # Comments, and what programs write without that word.
                pass
    if order == "":
        raise UnreadableError("the PLY header names no format that is known")
    return PlyHeader(_ORDERS[order], elements, end.end(), textures)


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
    tables = _text_tables(data, header) if header.order is None else _binary_tables(data, header)
    vertex, vertex_lists = _apart(tables.get("vertex", {}))
    if not {"x", "y", "z"} <= vertex.keys():
        raise UnreadableError("the PLY file has no vertices with x, y and z")
    lost: Counter[str] = Counter({"names of textures": header.textures})
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
        chosen = next((names for names in choices if set(names) <= left.keys()), ())
        if not chosen or (layer == COLOUR and len({left[name].dtype for name in chosen}) > 1):
            continue
        values = np.stack([left.pop(name) for name in chosen], axis=1)
        layers[layer] = _colours(values) if layer == COLOUR else values.astype(np.float64)
    return layers | {f"_{name}": column[:, None] for name, column in left.items()}


def _colours(values: np.ndarray) -> np.ndarray:
    """Return colours as fractions, bytes or words: those of other integers are of 0 to 255."""
    if values.dtype.kind == "f" or values.dtype.str[1:] in ("u1", "u2"):
        return values
    return np.clip(values, 0, 255).astype(np.uint8)


def _face_values(face: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what faces have beside their corners."""
    values = {name: column[:, None] for name, column in face.items()}
    names = [name for name in ("red", "green", "blue", "alpha") if name in values]
    if len(names) >= 3 and len({values[name].dtype for name in names}) == 1:
        values[COLOUR] = _colours(np.hstack([values.pop(name) for name in names]))
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


def _text_tables(data: bytes, header: PlyHeader) -> dict[str, _Columns]:
    """Read a text: numbers count, wherever its lines end."""
    body = plain_text(data[header.end :])
    if b"comment" in body or b"obj_info" in body:
        body = _REMARK.sub(b"", body)
    numbers = parsed(body)
    if len(numbers) != count_words(body):
        text = cut_text(body, "PLY", plain_text(data[: header.end]).count(b"\n"))
        numbers = text.numbers(np.arange(len(text.begins)))

    def length(at: int, _: str) -> int:
        return int(numbers[at])

    def taken(places: Int[np.ndarray, " N"], kind: str) -> Shaped[np.ndarray, " N"]:
        return _typed(numbers[places], kind)

    return _tables(header, _Store(0, len(numbers), lambda _: 1, length, taken))


def _binary_tables(data: bytes, header: PlyHeader) -> dict[str, _Columns]:
    letters, order = np.frombuffer(data, dtype=np.uint8), header.order or "<"
    names = {"<": "little", ">": "big"}

    def length(at: int, kind: str) -> int:
        if kind == "u1":
            return data[at]
        part = data[at : at + int(kind[1])]
        return int.from_bytes(part, names[order], signed=kind[0] == "i")  # type: ignore[arg-type]

    def taken(places: Int[np.ndarray, " N"], kind: str) -> Shaped[np.ndarray, " N"]:
        width = int(kind[1])
        step = int(places[1] - places[0]) if len(places) > 1 else width
        if len(places) and places[-1] - places[0] == step * (len(places) - 1) and step >= width:
            # Evenly spaced in most files: no index for each byte.
            view = np.ndarray(len(places), order + kind, data, int(places[0]), (step,))
            if (np.diff(places) == step).all():
                return view.astype(kind)
        parts = letters[places[:, None] + np.arange(width)].reshape(-1)
        return parts.view(order + kind).astype(kind)

    return _tables(header, _Store(header.end, len(data), lambda kind: int(kind[1]), length, taken))


@dataclass(frozen=True)
class _Store:
    """Numbers to be read: words of a text, or bytes.

    Attributes:
        begin, end: the places of the first number and behind the last.
        width: how many places a number of a type takes.
        length: returns the length of a list, whose count is at a place.
        taken: returns the numbers of a type at places.
    """

    begin: int
    end: int
    width: Callable[[str], int]
    length: Callable[[int, str], int]
    taken: Callable[[Int[np.ndarray, " N"], str], Shaped[np.ndarray, " N"]]


def _tables(header: PlyHeader, store: _Store) -> dict[str, _Columns]:
    tables: dict[str, _Columns] = {}
    at = store.begin
    for element in header.elements:
        tables[element.name], at = _columns(element, at, store)
    return tables


def _columns(element: Element, at: int, store: _Store) -> tuple[_Columns, int]:
    """Read the rows of an element from a place on; return also where they end."""
    begins, sizes, end = _places(element, at, store)
    columns: _Columns = {}
    for own, begin, size in zip(element.properties, begins, sizes, strict=True):
        if own.count_kind is None:
            columns[own.name] = store.taken(begin, own.kind)
            continue
        width = store.width(own.kind)
        firsts = np.repeat(begin - width * (np.cumsum(size) - size), size)
        columns[own.name] = _List(
            size, store.taken(firsts + width * np.arange(len(firsts)), own.kind)
        )
    return columns, end


def _places(
    element: Element, at: int, store: _Store
) -> tuple[list[Int[np.ndarray, " N"]], list[Int[np.ndarray, " N"]], int]:
    """Return where each property's numbers begin in each row, how many, and where all end."""
    widths = [store.width(own.kind) for own in element.properties]
    heads = [0 if p.count_kind is None else store.width(p.count_kind) for p in element.properties]
    own = list(zip(element.properties, widths, heads, strict=True))
    rows, first = element.rows, _row(own, at, store) if element.rows else [1] * len(own)
    if not own:
        return [], [], at
    if first is not None:
        # Where all lists are as long as the first row's, all rows are.
        spans = [head + width * size for (_, width, head), size in zip(own, first, strict=True)]
        inside = np.cumsum([0, *spans])
        whole = at + rows * int(inside[-1])
        starts = at + int(inside[-1]) * np.arange(rows if whole <= store.end else 0)
        if whole <= store.end and all(
            kind.count_kind is None or (store.taken(starts + begin, kind.count_kind) == size).all()
            for (kind, _, _), begin, size in zip(own, inside, first, strict=False)
        ):
            places = [starts + b + head for b, (_, _, head) in zip(inside, own, strict=False)]
            return places, [np.full(rows, size) for size in first], whole
    begins: list[list[int]] = [[] for _ in own]
    sizes: list[list[int]] = [[] for _ in own]
    # One by one: each row begins where another ends.
    for row in range(rows):
        found = _row(own, at, store)
        if found is None:
            raise _too_short(element, row)
        for number, size in enumerate(found):
            at += heads[number]
            begins[number].append(at)
            sizes[number].append(size)
            at += widths[number] * size
    return [np.array(b) for b in begins], [np.array(s) for s in sizes], at


def _row(own: list[tuple[Property, int, int]], at: int, store: _Store) -> list[int] | None:
    """Return how many numbers each property has in the row at a place; None if it is cut off."""
    sizes: list[int] = []
    for kind, width, head in own:
        size = 1
        if kind.count_kind is not None:
            if at + head > store.end:
                return None
            size = store.length(at, kind.count_kind)
        at += head + width * size
        if size < 0 or at > store.end:
            return None
        sizes.append(size)
    return sizes


def _typed(values: Shaped[np.ndarray, " N"], kind: str) -> Shaped[np.ndarray, " N"]:
    """Return numbers in the type that the header gives; floats of text stay as they are read."""
    if kind[0] == "f":
        return values.astype(np.float64)
    if (values != np.floor(values)).any():
        wrong = float(values[np.argmax(values != np.floor(values))])
        raise UnreadableError(f"the PLY file has {wrong:g} where its header says a whole number")
    bounds = np.iinfo(kind)
    return np.clip(values, bounds.min, bounds.max).astype(kind)


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
        values = np.zeros((len(mesh.vertices), layer.values.shape[1]), dtype=layer.values.dtype)
        values[mesh.corners] = layer.values[layer.rows]
        names = _names_of(name, values.shape[1])
        kind = values.dtype.str[1:]
        add(names, values, "f4" if kind == "f8" or kind not in _NAMES else kind)
    vertex = _records(fields, columns, len(mesh.vertices))
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    head += [f"property {_NAMES[kind]} {name}" for name, kind in fields]
    fields, columns = [], []
    for name, values in mesh.face_values.items():
        add(_names_of(name, values.shape[1]), values, values.dtype.str[1:])
    head += [f"element face {len(mesh.sizes)}", "property list uchar int vertex_indices"]
    head += [f"property {_NAMES[kind]} {name}" for name, kind in fields]
    faces = _face_bytes(mesh, fields, columns)
    return b"".join(["\n".join([*head, "end_header\n"]).encode("latin-1"), vertex.tobytes(), faces])


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
) -> Shaped[np.ndarray, " N"]:
    kinds = [(f"c{place}", f"<{kind}") for place, (_, kind) in enumerate(fields)]
    table = np.zeros(rows, dtype=kinds)
    for (name, _), column in zip(kinds, columns, strict=True):
        table[name] = column
    return table


def _face_bytes(mesh: MeshFile, fields: list[tuple[str, str]], columns: list[np.ndarray]) -> bytes:
    """Write polygons: a byte for the count, the corners, and what faces have beside them."""
    sizes = mesh.sizes
    kinds = [(f"c{place}", f"<{kind}") for place, (_, kind) in enumerate(fields)]
    if len(sizes) and (sizes == sizes[0]).all():
        size = int(sizes[0])
        table = np.zeros(len(sizes), [("n", "u1"), ("corners", "<i4", (size,)), *kinds])
        table["n"], table["corners"] = size, mesh.corners.reshape(-1, size)
        for (name, _), column in zip(kinds, columns, strict=True):
            table[name] = column
        return table.tobytes()
    corners = mesh.corners.astype("<i4").tobytes()
    behind = _records(fields, columns, len(sizes))
    offsets = (4 * mesh.offsets).tolist()
    return b"".join(
        bytes([size]) + corners[begin:end] + behind[face].tobytes()
        for face, (size, begin, end) in enumerate(
            zip(sizes.tolist(), offsets[:-1], offsets[1:], strict=True)
        )
    )
