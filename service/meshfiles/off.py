"""The Object File Format: text or binary, faces with any number of corners, colours behind them.

trimesh and meshio stop at polygons, at headers that are not alone on their line, and at comments.
"""

from __future__ import annotations

import re

import numpy as np
from jaxtyping import Float, Int

from ..errors import UnreadableError
from .mesh_file import COLOUR, NORMAL, UV, Layer, MeshFile, colours_of, dropped, offsets_of
from .text import NUMBER, Text, cut_text, plain_text, rows_text

# The counts may be glued to it: hundreds of files of ModelNet40 begin with "OFF216 183 0". Or they
# stand alone: Geomview asks for no header. Open3D writes NCOFF where Geomview has CNOFF.
HEADER = re.compile(
    rb"\s*(?:#[^\n]*\n\s*)*(?:((?:ST|[CN4])*)(?i:OFF)(?:[ \t]+(BINARY))?|(?=\d+[ \t]+\d+\s))"
)
_CUT_OFF = "the OFF file ends before its last face, or has none"


def read_off(data: bytes) -> MeshFile:
    """Read positions and polygons, and the colours, normals and texture coordinates with them.

    Raises:
        UnreadableError: not an OFF file, or one without all of its faces.
    """
    header = HEADER.match(data)
    if header is not None and header[2]:
        return _of_binary(data, data.find(b"\n", header.end()) + 1, header[1] or b"")
    data = plain_text(data)
    header = HEADER.match(data)
    if header is None:
        raise UnreadableError("this is not an OFF file: it begins neither with OFF nor with counts")
    text = cut_text(data[header.end() :], "OFF", data.count(b"\n", 0, header.end()))
    # Vertices, faces, edges: the last is of no use, and some programs leave it out.
    counts = text.numbers(np.arange(min(2, len(text.begins))), np.int64)
    if len(counts) < 2:
        raise UnreadableError("the OFF file has no counts of vertices and faces")
    vertex_count, face_count = counts.tolist()
    begin = 2 + _has_edge_count(text)
    # Before anything is made of them: a vertex is three words at least, a face two.
    words = len(text.begins) - begin
    if min(vertex_count, face_count - 1) < 0 or 3 * vertex_count + 2 * face_count > words:
        raise UnreadableError(_CUT_OFF)
    widths = _widths(header[1] or b"")
    width = sum(widths.values()) - widths[COLOUR]
    table, at = _vertices(text, begin, vertex_count, width, widths[COLOUR] > 0)
    widths[COLOUR] = table.shape[1] - width
    sizes, corners, of_faces, end = _faces(text, at, face_count)
    lost = {"words behind the last face": len(text.begins) - end}
    return _mesh(table, widths, sizes, corners, of_faces, lost)


def is_binary(data: bytes) -> bool:
    """Return whether the header says that numbers follow as words of four bytes."""
    header = HEADER.match(data)
    return header is not None and header[2] is not None


def _widths(prefix: bytes) -> dict[str, int]:
    """Return how many numbers of each kind a vertex has, in their order."""
    uv, colour, normal, w = (kind in prefix for kind in (b"ST", b"C", b"N", b"4"))
    return {"": 3, "w": int(w), NORMAL: 3 * normal, COLOUR: 4 * colour, UV: 2 * uv}


def _mesh(
    table: Float[np.ndarray, "V K"],
    widths: dict[str, int],
    sizes: Int[np.ndarray, " F"],
    corners: Int[np.ndarray, " C"],
    of_faces: Float[np.ndarray, "F K"] | None,
    lost: dict[str, int],
) -> MeshFile:
    """Return a mesh of the numbers of vertices, and faces with colours: None where some have."""
    columns = np.split(table, np.cumsum([*widths.values()])[:-1], axis=1)
    parts = dict(zip(widths, columns, strict=True))
    lost = {"fourth coordinates": int((parts["w"] != 1).sum()), **lost}
    if widths[COLOUR] not in (0, 3, 4):
        lost["values of vertices"] = len(table)
        del parts[COLOUR]
    elif widths[NORMAL] and widths[COLOUR] and _is_colour_first(parts[NORMAL], parts[COLOUR]):
        both = np.hstack([parts[NORMAL], parts[COLOUR]])
        parts[COLOUR], parts[NORMAL] = both[:, :-3], both[:, -3:]
    face_values: dict[str, np.ndarray] = {}
    if of_faces is None:
        lost["colours of faces"] = len(sizes)
    elif of_faces.shape[1] > 0:
        face_values[COLOUR] = colours_of(of_faces)
    layers = {
        name: Layer(parts[name], corners)
        for name in (NORMAL, COLOUR, UV)
        if name in parts and widths[name]
    }
    if COLOUR in layers:
        layers[COLOUR] = Layer(colours_of(layers[COLOUR].values), layers[COLOUR].rows)
    return MeshFile(
        parts[""],
        offsets_of(sizes),
        corners,
        layers,
        face_values=face_values,
        changes=dropped(lost),
    )


def _is_colour_first(normals: np.ndarray, colours: np.ndarray) -> bool:
    """Return whether normals and colours stand in MeshLab's order, which is not Geomview's.

    No colour is negative, and no normal has whole numbers beyond 1.
    """
    whole = (normals == np.rint(normals)).all() and (normals > 1).any()
    return bool(whole or (colours < 0).any())


def _of_binary(data: bytes, at: int, prefix: bytes) -> MeshFile:
    """Read what follows the header of a binary file: words of four bytes, the highest first.

    Some programs write the lowest first.
    """
    words, widths = (len(data) - at) // 4, _widths(prefix)
    width = sum(widths.values())
    for order in ">", "<":
        whole = np.frombuffer(data, f"{order}i4", words, at)
        if words < 3:
            break
        vertex_count, face_count = whole[:2].tolist()
        begin = 3 + width * vertex_count
        # A face has its size and the number of its colour's components.
        if vertex_count >= 0 and face_count > 0 and begin + 2 * face_count <= words:
            table = np.frombuffer(data, f"{order}f4", begin - 3, at + 12).reshape(-1, width)
            return _with_binary_faces(table.astype(np.float64), widths, whole[begin:], face_count)
    raise UnreadableError(_CUT_OFF)


def _with_binary_faces(
    table: Float[np.ndarray, "V K"], widths: dict[str, int], words: np.ndarray, count: int
) -> MeshFile:
    """Read binary faces: a size, corners, and how many components of a colour follow."""
    size = int(words[0])
    colour = int(words[1 + size]) if 0 <= size < len(words) - 1 else -1
    stride = size + 2 + colour
    if colour >= 0 and count * stride <= len(words):
        rows = words[: count * stride].reshape(count, stride)
        if (rows[:, [0, 1 + size]] == (size, colour)).all():
            places = stride * np.arange(count)
            return _binary_mesh(table, widths, words, places, count * stride)
    places, at, values = np.zeros(count, dtype=np.int64), 0, words.tolist()
    # One by one: where a face begins depends on the sizes of those before it.
    for face in range(count):
        places[face] = at
        for _ in range(2):
            if at >= len(values) or not 0 <= values[at] < len(values) - at:
                raise UnreadableError(_CUT_OFF)
            at += 1 + values[at]
    return _binary_mesh(table, widths, words, places, at)


def _binary_mesh(
    table: Float[np.ndarray, "V K"],
    widths: dict[str, int],
    words: np.ndarray,
    places: Int[np.ndarray, " F"],
    end: int,
) -> MeshFile:
    sizes = words[places].astype(np.int64)
    corners = words[_behind(places, sizes)].astype(np.int64)
    components, of_faces = words[places + 1 + sizes], None
    if (components == components[0]).all() and components[0] in (0, 3, 4):
        behind = (places + 2 + sizes)[:, None] + np.arange(components[0])
        of_faces = words.view(f"{words.dtype.byteorder}f4")[behind].astype(np.float64)
    lost = {"words behind the last face": len(words) - end}
    return _mesh(table, widths, sizes, corners, of_faces, lost)


def _has_edge_count(text: Text) -> bool:
    """Return whether a third count follows, on the line of the second or alone on its own."""
    if len(text.begins) < 3:
        return False
    line = np.searchsorted(text.first, [1, 2], "right") - 1
    return bool(line[0] == line[1] or text.counts[line[1]] == 1)


def _rows_of(text: Text, word: int, count: int) -> Int[np.ndarray, " K"] | None:
    """Return so many lines with words, from a word on; None where that is not the first of one."""
    filled = np.flatnonzero(text.counts)
    place = int(np.searchsorted(text.first[filled], word))
    lines = filled[place : place + count]
    starts = len(lines) == count and count > 0 and text.first[lines[0]] == word
    return lines if starts else None


def _vertices(
    text: Text, begin: int, count: int, width: int, colour: bool
) -> tuple[Float[np.ndarray, "V K"], int]:
    """Read vertices, a line each or wherever their lines end; return also where they end.

    What stands behind the `width` numbers that the header names is their colour.
    """
    lines = _rows_of(text, begin, count)
    if lines is not None and (text.counts[lines] >= width).all():
        counts, end = text.counts[lines], int(text.first[lines[-1]] + text.counts[lines[-1]])
        values = text.numbers(np.arange(begin, end))
        if (counts == counts[0]).all():
            return values.reshape(count, -1), end
        return values[(text.first[lines] - begin)[:, None] + np.arange(width)], end
    width += 4 * colour
    end = begin + count * width
    if end > len(text.begins):
        raise UnreadableError(_CUT_OFF)
    return text.numbers(np.arange(begin, end)).reshape(count, width), end


def _faces(
    text: Text, begin: int, count: int
) -> tuple[Int[np.ndarray, " F"], Int[np.ndarray, " C"], Float[np.ndarray, "F K"] | None, int]:
    """Read sizes, corners, and colours; None where only some faces have one.

    Return also where the last face ends.
    """
    lines = _rows_of(text, begin, count)
    if lines is not None:
        end = int(text.first[lines[-1]] + text.counts[lines[-1]])
        numbers = text.numbers(np.arange(begin, end))
        places = text.first[lines] - begin
        sizes = _whole(text, numbers, places, begin)
        left = text.counts[lines] - 1 - sizes
        if (sizes >= 0).all() and (left >= 0).all():
            corners = _whole(text, numbers, _behind(places, sizes), begin)
            colours = None
            if (left == left[0]).all() and left[0] in (0, 3, 4):
                colours = numbers[(places + 1 + sizes)[:, None] + np.arange(left[0])]
            return sizes, corners, colours, end
    numbers = text.numbers(np.arange(begin, len(text.begins)))
    begins: list[int] = []
    at = 0
    # One by one: where a face begins depends on the sizes of those before it.
    for _ in range(count):
        if at >= len(numbers) or not 0 <= numbers[at] < len(numbers) - at:
            raise UnreadableError(_CUT_OFF)
        begins.append(at)
        at += 1 + int(numbers[at])
    places = np.array(begins)
    sizes = _whole(text, numbers, places, begin)
    corners = _whole(text, numbers, _behind(places, sizes), begin)
    return sizes, corners, np.zeros((count, 0)), begin + at


def _behind(places: Int[np.ndarray, " F"], sizes: Int[np.ndarray, " F"]) -> Int[np.ndarray, " C"]:
    """Return the places of so many numbers behind each place."""
    firsts = np.repeat(places + 1 - (np.cumsum(sizes) - sizes), sizes)
    return firsts + np.arange(len(firsts))


def _whole(
    text: Text, numbers: Float[np.ndarray, " N"], places: Int[np.ndarray, " K"], begin: int
) -> Int[np.ndarray, " K"]:
    values = numbers[places]
    fits = (np.abs(values) < 2**53) & (values == np.floor(values))
    if not fits.all():
        raise text.word_fault(begin + int(places[np.argmin(fits)]), "no count or vertex")
    return values.astype(np.int64)


def write_off(mesh: MeshFile) -> bytes:
    """Write the file's bytes; every layer belongs to vertices."""
    kept = {name: mesh.layers[name] for name in (NORMAL, COLOUR, UV) if name in mesh.layers}
    prefix = f"{'ST' * (UV in kept)}{'C' * (COLOUR in kept)}{'N' * (NORMAL in kept)}"
    columns, form = [mesh.vertices], f"{NUMBER} {NUMBER} {NUMBER}"
    for name, layer in kept.items():
        values = np.zeros((len(mesh.vertices), layer.values.shape[1]))
        values[mesh.corners] = layer.values[layer.rows]
        columns.append(values)
        form += (_form(layer.values) if name == COLOUR else f" {NUMBER}") * values.shape[1]
    pieces = [f"{prefix}OFF\n{len(mesh.vertices)} {len(mesh.sizes)} 0\n".encode()]
    pieces += rows_text(f"{form}\n", np.hstack(columns))
    colours = mesh.face_values.get(COLOUR)
    behind = "" if colours is None else _form(colours) * colours.shape[1]
    sizes = mesh.sizes
    for size in np.unique(sizes).tolist():
        chosen = sizes == size
        faces = mesh.corners[np.repeat(chosen, sizes)].reshape(-1, size)
        rows = [np.full((len(faces), 1), size), faces]
        rows += [] if colours is None else [colours[chosen]]
        pieces += rows_text(f"%d{' %d' * size}{behind}\n", np.hstack(rows))
    return b"".join(pieces)


def _form(colours: np.ndarray) -> str:
    """Return how components are written: a fraction with its point, since 1 is one of 255."""
    return " %d" if colours.dtype.kind in "ui" else " %#.12g"
