"""Wavefront OBJ: polygons whose corners name positions, texture coordinates and normals apart.

No reader in Python was fit: trimesh takes a polygon for a fan and drops colours, groups and hard
edges; meshio reads a line at a time and drops normals and materials; tinyobjloader has no wheels.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from io import BytesIO
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.kernels.text import write_faces

from .mesh_file import (
    COLOUR,
    GROUP,
    MATERIAL,
    NONE,
    NORMAL,
    OBJECT,
    SMOOTHING,
    UV,
    Labels,
    Layer,
    MeshFile,
    as_fractions,
    colours_of,
    dropped,
    offsets_of,
)
from .tags import Tags
from .text import (
    BLOCK,
    NUMBER,
    Text,
    cut_text,
    encoding_of,
    named,
    parsed,
    plain_text,
    rows_text,
)

STATEMENTS = {MATERIAL: b"usemtl", GROUP: b"g", OBJECT: b"o", SMOOTHING: b"s"}
_LIBRARY, _TAG = b"mtllib", b"t"
_DROPPED = {
    b"l": "lines",
    b"p": "points",
    b"vp": "free-form curves",
    b"curv": "free-form curves",
    b"curv2": "free-form curves",
    b"surf": "free-form surfaces",
}
(_SLASH,) = b"/"
# Colours as ZBrush writes them.
_PAINT = re.compile(rb"(?m)^#MRGB[ \t]+([0-9A-Fa-f]+)")
_CONTINUED = re.compile(rb"(\\)([ \t]+)(?=\n)")
_REFERENCES = re.compile(rb"[+-]?\d+(?:/(?:[+-]?\d+)?){0,2}")


def read_obj(data: bytes) -> MeshFile:
    """Read an OBJ; indices below 0 count back from their own line, # may be part of a name.

    Raises:
        UnreadableError: a position or a face cannot be read, or names a vertex that there is not.
    """
    data = plain_text(data)
    if b"\\" in data:
        # Blanks behind a backslash, as editors leave them.
        data = _CONTINUED.sub(rb"\2\1", data)
    text = cut_text(data, "OBJ", continued=True)
    is_v, is_vt, is_vn = (text.keyword(word) for word in (b"v", b"vt", b"vn"))
    is_face = text.keyword(b"f") | text.keyword(b"fo")
    vertices, colours = _positions(text, is_v)
    references, sizes = _references(text, is_face)
    line = np.flatnonzero(is_face)
    v, vt, vn = (
        _absolute(column, np.cumsum(kind)[line], sizes)
        for column, kind in zip(references.T, (is_v, is_vt, is_vn), strict=True)
    )
    wrong = np.flatnonzero((v < 0) | (v >= len(vertices)))
    if len(wrong):
        name, face = int(references[wrong[0], 0]), int(np.repeat(line, sizes)[wrong[0]])
        there = int(is_v[:face].sum()) if name < 0 else len(vertices)
        why = "they count from 1" if name == 0 else f"there are {there}"
        raise text.fault(face, f"a face names vertex {name}, and {why}")
    lost: Counter[str] = Counter()
    layers = _layers(text, (is_vt, vt), (is_vn, vn), sizes, lost)
    painted = b"".join(_PAINT.findall(data)) if b"#MRGB" in data else b""
    if len(painted) == 8 * len(vertices):
        # Of each vertex a mask, and three bytes of its colour.
        colours = np.frombuffer(bytes.fromhex(painted.decode()), np.uint8).reshape(-1, 4)[:, 1:]
    elif painted:
        lost["colours that not all vertices have"] += 1
    if colours is not None:
        layers[COLOUR] = Layer(colours, v)
    others = ~(is_v | is_vt | is_vn | is_face)
    tags = _tags(text, others, lost)
    labels, libraries, encoding = _statements(text, data, others, line, lost)
    return MeshFile(
        vertices,
        offsets_of(sizes),
        v,
        layers,
        labels=labels,
        libraries=libraries,
        encoding=encoding,
        tags=tags,
        changes=dropped(lost),
    )


def _positions(
    text: Text, lines: Bool[np.ndarray, " L"]
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "V K"] | None]:
    """Read positions and, behind them, colours; vertices without one are white among others."""
    counts = text.counts[lines] - 1
    if (counts < 3).any():
        bad = np.flatnonzero(lines)[np.argmax(counts < 3)]
        raise text.fault(int(bad), f"a vertex has {text.counts[bad] - 1} coordinates")
    if not len(counts):
        return np.zeros((0, 3)), None
    values = text.numbers(text.words_of(lines))
    coloured = counts >= 6
    alike = bool((counts == counts[0]).all())
    rows = values.reshape(len(counts), -1) if alike else _rows(values, counts, 6)
    points = np.ascontiguousarray(rows[:, :3])
    if not coloured.any():
        return points, None
    given = colours_of(rows[coloured, 3:7])
    white = 255 if given.dtype == np.uint8 else 1
    colours = np.full((len(points), given.shape[1]), white, given.dtype)
    colours[coloured] = given
    return points, colours


def _references(
    text: Text, lines: Bool[np.ndarray, " L"]
) -> tuple[Int[np.ndarray, "C 3"], Int[np.ndarray, " F"]]:
    """Return what each corner names (0: nothing), and how many corners each face has."""
    words, sizes = text.words_of(lines), text.counts[lines] - 1
    letters = text.cut(words)
    if not (letters == _SLASH).any():
        references = np.zeros((len(words), 3), dtype=np.int64)
        references[:, 0] = text.numbers(words, np.int64)
        return references, sizes
    blank = letters <= ord(" ")
    at, ends = np.flatnonzero(letters == _SLASH), np.flatnonzero(blank)[: len(words)]
    corners = np.where(blank, np.uint8(ord(" ")), letters).tobytes()
    # What is left out is 0.
    corners = corners.replace(b"//", b"/0/").replace(b"/ ", b"/0 ").replace(b"/", b" ")
    values = parsed(corners, np.int64)
    each, rest = divmod(len(at), len(words))
    if not rest and each < 3 and len(values) == (1 + each) * len(words):
        at = at.reshape(len(words), each)
        # As many slashes in every word, as nearly all files have.
        if (at[:, -1] < ends).all() and (at[1:, 0] > ends[:-1]).all():
            references = np.zeros((len(words), 3), dtype=np.int64)
            references[:, : 1 + each] = values.reshape(len(words), -1)
            return references, sizes
    counts = 1 + np.diff(np.searchsorted(at.reshape(-1), ends), prepend=0)
    if counts.max() > 3 or len(values) != counts.sum():
        bad = next((w for w in words.tolist() if not _REFERENCES.fullmatch(text.word(w))), 0)
        raise text.word_fault(bad, "no corner of a face")
    places = np.arange(len(values)) - np.repeat(np.cumsum(counts) - counts, counts)
    references = np.zeros((len(words), 3), dtype=np.int64)
    references[np.repeat(np.arange(len(words)), counts), places] = values
    return references, sizes


def _absolute(
    references: Int[np.ndarray, " C"], above: Int[np.ndarray, " F"], sizes: Int[np.ndarray, " F"]
) -> Int[np.ndarray, " C"]:
    """Return rows from 0 on, below 0 where nothing is named; `above` are those before the line."""
    if not (references < 0).any():
        return references - 1
    return np.where(references < 0, np.repeat(above, sizes) + references, references - 1)


def _layers(
    text: Text,
    uv: tuple[Bool[np.ndarray, " L"], Int[np.ndarray, " C"]],
    normals: tuple[Bool[np.ndarray, " L"], Int[np.ndarray, " C"]],
    sizes: Int[np.ndarray, " F"],
    lost: Counter[str],
) -> dict[str, Layer]:
    """Read what corners name beside positions; what cannot be read is dropped.

    A face has values at all of its corners or at none.
    """
    layers: dict[str, Layer] = {}
    kinds = {
        UV: (*uv, 2, 1, "texture coordinates"),
        NORMAL: (*normals, 3, 3, "vertex normals"),
    }
    for name, (lines, rows, width, least, shown) in kinds.items():
        count = int(lines.sum())
        named = (rows >= 0) & (rows < count)
        lost[f"references to missing {shown}"] += int((~named & (rows != NONE)).sum())
        if not count:
            continue
        values = _values(text, lines, width, least) if named.any() else None
        if values is None:
            why = " that cannot be read" if named.any() else " that no face names"
            lost[shown + why] = count
            continue
        missing = np.bincount(np.repeat(np.arange(len(sizes)), sizes)[~named], minlength=len(sizes))
        partly = (missing > 0) & (missing < sizes)
        lost[f"{shown} of faces of which not all corners have some"] += int(partly.sum())
        named &= np.repeat(missing == 0, sizes)
        layers[name] = Layer(values, np.where(named, rows, NONE))
    return layers


def _values(
    text: Text, lines: Bool[np.ndarray, " L"], width: int, least: int
) -> Float[np.ndarray, "N K"] | None:
    """Return the first `width` numbers of lines, 0 for those left out; None where one is none."""
    counts = text.counts[lines] - 1
    words = text.words_of(lines)
    values = parsed(text.cut(words).tobytes())
    if (counts < least).any() or len(values) != len(words):
        return None
    rows = _rows(values, counts, width)
    return rows if np.isfinite(rows).all() else None


def _rows(
    values: Float[np.ndarray, " N"], counts: Int[np.ndarray, " R"], width: int
) -> Float[np.ndarray, "R K"]:
    """Return the first `width` of the numbers of each row, 0 for those that it has not."""
    starts = np.cumsum(counts) - counts
    rows = values[starts[:, None] + np.minimum(np.arange(width), counts[:, None] - 1)]
    rows[counts[:, None] <= np.arange(width)] = 0.0
    return rows


def _tags(text: Text, others: Bool[np.ndarray, " L"], lost: Counter[str]) -> Tags | None:
    """Return what OpenSubdiv's tags state; None without any that is understood."""
    tags = Tags()
    for line in np.flatnonzero(others & text.keyword(_TAG)).tolist():
        first = text.first[line]
        tags.read([text.word(first + k) for k in range(1, text.counts[line])], lost)
    return tags if tags.edges or tags.vertices or tags.border else None


def _statements(
    text: Text,
    data: bytes,
    others: Bool[np.ndarray, " L"],
    face_lines: Int[np.ndarray, " F"],
    lost: Counter[str],
) -> tuple[dict[str, Labels], tuple[str, ...], str]:
    """Return the names that statements give to the faces below them, the libraries, the encoding.

    `data` has the comments that are blank in the text. Other statements are counted as lost.
    """
    known = {word: kind for kind, word in STATEMENTS.items()}
    given: dict[str, list[tuple[int, bytes]]] = {kind: [] for kind in known.values()}
    libraries: dict[bytes, None] = {}
    for line in np.flatnonzero(others & (text.counts > 0)).tolist():
        first = text.first[line]
        word = text.word(first).lower()
        if word in known or word == _LIBRARY:
            end = text.starts[line + 1] if line + 1 < len(text.starts) else len(data)
            name = named(data[text.ends[first] : end].replace(b"\\\n", b" "))
            if word == _LIBRARY:
                libraries[name] = None
            else:
                given[known[word]].append((line, name))
        elif word in _DROPPED:
            lost[_DROPPED[word]] += 1
        elif word != _TAG:
            lost["other statements"] += 1
    encoding = encoding_of(b"".join([*libraries, *(n for own in given.values() for _, n in own)]))
    labels: dict[str, Labels] = {}
    for kind, entries in given.items():
        if not entries or not len(face_lines):
            continue
        numbers: dict[bytes, int] = {}
        of_entry = [numbers.setdefault(name, len(numbers)) for _, name in entries]
        place = np.searchsorted([line for line, _ in entries], face_lines) - 1
        of_face = np.where(place >= 0, np.array(of_entry)[place], NONE)
        labels[kind] = Labels(tuple(name.decode(encoding) for name in numbers), of_face)
    return labels, tuple(name.decode(encoding) for name in libraries), encoding


def write_obj(mesh: MeshFile) -> bytes:
    """Write the file's bytes; what faces are called stands before them.

    The first object stands before the vertices.
    """
    file = BytesIO()
    file.writelines(f"mtllib {name}\n".encode(mesh.encoding) for name in mesh.libraries)
    objects = mesh.labels.get(OBJECT)
    first = NONE if objects is None else int(objects.of_face[0])
    if objects is not None and first >= 0:
        file.write(f"o {objects.names[first]}\n".encode(mesh.encoding))
    colours = mesh.layers.get(COLOUR)
    rows = mesh.vertices
    if colours is not None:
        of_vertex = np.zeros((len(rows), 3))
        of_vertex[mesh.corners] = as_fractions(colours.values)[colours.rows, :3]
        rows = np.hstack([rows, of_vertex])
    file.writelines(rows_text(f"v{f' {NUMBER}' * rows.shape[1]}\n", rows))
    layers = [mesh.layers.get(name) for name in (UV, NORMAL)]
    for layer, form in zip(layers, (f"vt {NUMBER} {NUMBER}\n", "vn %.7g %.7g %.7g\n"), strict=True):
        if layer is not None:
            file.writelines(rows_text(form, layer.values))
    file.writelines(_faces_text(mesh, layers, first))
    return file.getvalue()


def _faces_text(
    mesh: MeshFile, layers: Sequence[Layer | None], said_object: int
) -> Iterator[bytes]:
    """Write faces, run by run of those with the same names and the same kinds of references."""
    count = len(mesh.sizes)
    named = [_of_faces(mesh, layer) for layer in layers]
    labels = {kind: label.of_face for kind, label in mesh.labels.items()}
    turns = np.zeros(max(count - 1, 0), dtype=bool)
    for column in (*named, *labels.values()):
        turns |= column[1:] != column[:-1]
    bounds = [0, *(np.flatnonzero(turns) + 1).tolist(), count]
    said = dict.fromkeys(labels, NONE) | {OBJECT: said_object}
    rows = [_WITHOUT if layer is None else layer.rows for layer in layers]
    columns = [np.ascontiguousarray(column, np.int64) for column in (mesh.corners, *rows)]
    digits = sum(1 + len(str(column.max(initial=0) + 1)) for column in columns)
    for begin, end in pairwise(bounds):
        for kind, of_face in labels.items():
            number = int(of_face[begin])
            # One that has no name behind one that has would take that one's.
            if number != said[kind]:
                name = mesh.labels[kind].names[number] if number >= 0 else _NAMELESS[kind]
                yield STATEMENTS[kind] + f" {name}\n".encode(mesh.encoding)
                said[kind] = number
        given = [columns[0]]
        for column, of_face in zip(columns[1:], named, strict=True):
            given.append(column if of_face[begin] else _WITHOUT)
        for start in range(begin, end, BLOCK):
            stop = min(start + BLOCK, end)
            longest = 2 * (stop - start) + digits * int(mesh.offsets[stop] - mesh.offsets[start])
            out = np.empty(longest, dtype=np.int8)
            yield out[: write_faces(mesh.offsets, start, stop, *given, out)].tobytes()


_WITHOUT = np.zeros(0, dtype=np.int64)
_NAMELESS = {MATERIAL: "none", GROUP: "default", OBJECT: "default", SMOOTHING: "off"}


def _of_faces(mesh: MeshFile, layer: Layer | None) -> Bool[np.ndarray, " F"]:
    """Return which faces have a value at every corner."""
    if layer is None or layer.rows.min() >= 0:
        return np.full(len(mesh.sizes), layer is not None)
    return np.logical_and.reduceat(layer.rows >= 0, mesh.offsets[:-1])
