"""3MF: the parts of a 3D print, their colours and their unit, as XML in a .zip.

Core Specification 1.3, Materials and Properties Extension 1.2 and Production Extension 1.1 of the
3MF Consortium. Parts that are placed several times are there several times.
"""

from __future__ import annotations

import zipfile
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from pns_common.mesh.rows import distinct_rows, number_by_first_appearance

from ..bodies.archive import Unpacker, unpacker_of
from ..errors import UnreadableError, UnrefinableError, check_limit
from .mesh_file import (
    COLOUR,
    MATERIAL,
    NONE,
    OBJECT,
    Labels,
    Layer,
    MeshFile,
    as_fractions,
    dropped,
)
from .text import NUMBER, rows_text

UNIT = "millimeter"
# Its units in metres, those of a glTF.
METRES = {
    "micron": 1e-6,
    UNIT: 1e-3,
    "centimeter": 1e-2,
    "inch": 0.0254,
    "foot": 0.3048,
    "meter": 1.0,
}
# Copies of copies of a part are few bytes: what they are placed as is counted before it is made.
MOST_PLACED = 2**24
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_MATERIAL = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
_PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
# What a file may say that it cannot be read without: of the others geometry is no triangles.
_KNOWN = {_CORE, _MATERIAL, _PRODUCTION}
_PATH = f"{_PRODUCTION} path"
_ROOT = "3D/3dmodel.model"
# A triangle: its vertices, its group of properties, and those of its corners.
_TRIANGLE = 7
_OWN = {"v1", "v2", "v3", "pid", "p1", "p2", "p3"}
_WHITE = '"#FFFFFFFF"'
_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    f'<Relationship Target="/{_ROOT}" Id="rel0" Type="{_MODEL}"/></Relationships>\n'
)
# The same file has the same bytes, whenever it is written.
_WRITTEN = (1980, 1, 1, 0, 0, 0)

# An object or a group of properties: the part of the package that it is in, and its number there.
Key = tuple[str, str]
Placed = tuple[Key, Float[np.ndarray, "4 3"]]


@dataclass(eq=False)
class _Object:
    """An object: triangles, or other objects placed in it."""

    name: str
    group: str | None
    index: int
    points: array[float] = field(default_factory=lambda: array("d"))
    triangles: array[int] = field(default_factory=lambda: array("q"))
    components: list[Placed] = field(default_factory=list)


@dataclass(eq=False)
class _Package:
    """The contents of a package.

    Attributes:
        objects: by part and number.
        colours: of all groups, one after the other.
        groups: where the colours of each group begin, and how many they are.
        materials: the name of each colour that is a material's.
        items: what is printed.
        parts: the models, in the order in which they are named.
        unit: of lengths.
        lost: what was passed over.
    """

    objects: dict[Key, _Object] = field(default_factory=dict)
    colours: list[tuple[int, ...]] = field(default_factory=list)
    groups: dict[Key, tuple[int, int]] = field(default_factory=dict)
    materials: dict[int, str] = field(default_factory=dict)
    items: list[Placed] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    unit: str = UNIT
    lost: Counter[str] = field(default_factory=Counter)


def unpacked_size(data: bytes) -> int:
    """Return how many bytes a package says that it unpacks to. Raises as `read_3mf`."""
    return sum(entry.file_size for entry in unpacker_of(data).entries.values())


def read_3mf(data: bytes) -> MeshFile:
    """Read what is printed: each copy of a part is an object, named as the part.

    Raises:
        UnreadableError: no package with a 3D model, or one that needs what is not read here.
        UnrefinableError: a triangle names a vertex that there is not.
        LimitError: the parts are placed too often.
    """
    files = unpacker_of(data)
    package = _Package()
    package.parts.append(_root_of(files))
    # A model names others while it is read.
    for number, part in enumerate(package.parts):
        _Reader(package, part, root=number == 0).read(_content(files, part))
    read = {part.lower() for part in package.parts}
    others = [
        name
        for name in files.entries
        if name.lower() not in read and not name.endswith((".rels", "[Content_Types].xml"))
    ]
    package.lost["other files of the package"] = len(others)
    return _mesh_of(package)


def _content(files: Unpacker, part: str) -> bytes:
    # Names of parts do not tell capitals from small letters.
    found = [name for name in files.entries if name.lower() == part.lower()]
    if not found:
        raise UnreadableError(f"the 3MF file has no part {part}")
    return bytes(files.read(found[0]).content)


def _root_of(files: Unpacker) -> str:
    """Return the part that the package names as its model."""
    if "_rels/.rels" not in files.entries:
        raise UnreadableError("this is not a 3MF file: the archive names no 3D model")
    targets: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if attributes.get("Type") == _MODEL:
            targets.append(attributes["Target"].lstrip("/"))

    _parse(_content(files, "_rels/.rels"), "_rels/.rels", start)
    if not targets:
        raise UnreadableError("this is not a 3MF file: the archive names no 3D model")
    return targets[0]


def _parse(
    content: bytes,
    part: str,
    start: Callable[[str, dict[str, str]], None],
    prefix: Callable[[str | None, str | None], None] = lambda prefix, uri: None,
) -> None:
    """Read XML; an element of a namespace is `NAMESPACE name`."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = start
    parser.StartNamespaceDeclHandler = prefix
    parser.buffer_text = True

    def refuse(*_: object) -> None:
        raise ValueError("a 3MF file has no DTD")

    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise UnreadableError(f"{part} of the 3MF file is no XML: {error}") from error
    except KeyError as error:
        raise _fault(parser, part, f"{error} is missing") from error
    except (ValueError, OverflowError) as error:
        raise _fault(parser, part, str(error)) from error


def _fault(parser: expat.XMLParserType, part: str, problem: str) -> UnreadableError:
    return UnreadableError(f"line {parser.CurrentLineNumber} of {part} of the 3MF file: {problem}")


class _Reader:
    """Reads one model of a package into it."""

    def __init__(self, package: _Package, part: str, *, root: bool) -> None:
        self.package, self.part, self.root = package, part, root
        self.prefixes: dict[str, str] = {}
        self.object = _Object("", None, 0)
        self.group = ""
        self.starts: dict[str, Callable[[dict[str, str]], None]] = {
            f"{_CORE} model": self._model,
            f"{_CORE} object": self._object,
            f"{_CORE} vertex": self._vertex,
            f"{_CORE} triangle": self._triangle,
            f"{_CORE} component": self._component,
            f"{_CORE} item": self._item,
            f"{_CORE} basematerials": self._begin_group,
            f"{_CORE} base": self._base,
            f"{_MATERIAL} colorgroup": self._begin_group,
            f"{_MATERIAL} color": self._colour,
        }
        self.lost = {
            f"{_CORE} metadata": "metadata",
            f"{_MATERIAL} texture2d": "textures",
            f"{_MATERIAL} multiproperties": "mixed properties",
            f"{_MATERIAL} compositematerials": "mixed materials",
        }

    def read(self, content: bytes) -> None:
        """Read the part."""
        _parse(content, self.part, self._start, self._prefix)

    def _prefix(self, prefix: str | None, uri: str | None) -> None:
        self.prefixes[prefix or ""] = uri or ""

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if (start := self.starts.get(name)) is not None:
            start(attributes)
        elif name in self.lost:
            self.package.lost[self.lost[name]] += 1

    def _model(self, attributes: dict[str, str]) -> None:
        for prefix in attributes.get("requiredextensions", "").split():
            uri = self.prefixes.get(prefix, prefix)
            if uri not in _KNOWN:
                raise ValueError(f"it needs the extension {uri}, which is not read here")
        if self.root:
            self.package.unit = attributes.get("unit", UNIT)
            if self.package.unit not in METRES:
                raise ValueError(f"unit {self.package.unit!r} must be one of {', '.join(METRES)}")

    def _object(self, attributes: dict[str, str]) -> None:
        number = attributes["id"]
        self.object = _Object(
            attributes.get("name", ""), attributes.get("pid"), int(attributes.get("pindex", 0))
        )
        self.package.objects[self.part, number] = self.object

    def _vertex(self, attributes: dict[str, str]) -> None:
        place = float(attributes["x"]), float(attributes["y"]), float(attributes["z"])
        self.object.points.extend(place)

    def _triangle(self, attributes: dict[str, str]) -> None:
        given, own = attributes.get, self.object
        row = [int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])]
        group = given("pid", own.group)
        if group is None:
            row += [NONE] * 4
        elif (first := given("p1")) is None:
            row += [int(group), own.index, own.index, own.index]
        else:
            row += [int(group), int(first), int(given("p2", first)), int(given("p3", first))]
        own.triangles.extend(row)
        if len(attributes) > 3 and not attributes.keys() <= _OWN:
            self.package.lost["paint of triangles"] += 1

    def _component(self, attributes: dict[str, str]) -> None:
        self.object.components.append(self._placed(attributes))

    def _item(self, attributes: dict[str, str]) -> None:
        if self.root and attributes.get("printable") != "0":
            self.package.items.append(self._placed(attributes))

    def _placed(self, attributes: dict[str, str]) -> Placed:
        part = attributes.get(_PATH, self.part).lstrip("/")
        if part not in self.package.parts:
            self.package.parts.append(part)
        numbers = [float(word) for word in attributes.get("transform", "").split()]
        if not numbers:
            return (part, attributes["objectid"]), np.vstack([np.eye(3), np.zeros(3)])
        if len(numbers) != 12 or not np.isfinite(numbers).all():
            raise ValueError("a transform has twelve numbers")
        return (part, attributes["objectid"]), np.reshape(numbers, (4, 3))

    def _begin_group(self, attributes: dict[str, str]) -> None:
        self.group = str(int(attributes["id"]))
        self.package.groups[self.part, self.group] = len(self.package.colours), 0

    def _base(self, attributes: dict[str, str]) -> None:
        self.package.materials[len(self.package.colours)] = attributes["name"]
        self._add(attributes["displaycolor"])

    def _colour(self, attributes: dict[str, str]) -> None:
        self._add(attributes["color"])

    def _add(self, text: str) -> None:
        values = bytes.fromhex(text.removeprefix("#"))
        if len(values) not in (3, 4):
            raise ValueError(f"{text!r} is no colour #RRGGBB or #RRGGBBAA")
        self.package.colours.append((*values, 255)[:4])
        begin, count = self.package.groups[self.part, self.group]
        self.package.groups[self.part, self.group] = begin, count + 1


def _mesh_of(package: _Package) -> MeshFile:
    """Return all that is printed as one mesh."""
    check_limit("faces", _placed_faces(package), MOST_PLACED, "the 3MF file's parts have too many")
    names, points, faces, rows = list[str](), list[np.ndarray](), list[np.ndarray](), []
    known: dict[Key, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    count = 0
    for key, matrix in _placements(package):
        own = package.objects[key]
        if key not in known:
            known[key] = _arrays(package, key)
        places, triangles, colours = known[key]
        # A mirror turns a part inside out.
        turn = [0, 2, 1] if np.linalg.det(matrix[:3]) < 0 else [0, 1, 2]
        names.append(own.name)
        points.append(places @ matrix[:3] + matrix[3])
        faces.append(triangles[:, turn] + count)
        rows.append(colours[:, turn])
        count += len(places)
    if not names:
        raise UnreadableError("the 3MF file prints no triangles")
    sizes = [len(each) for each in faces]
    corners, colour = np.concatenate(faces).reshape(-1), np.concatenate(rows).reshape(-1)
    labels: dict[str, Labels] = {}
    if len(names) > 1 or names[0]:
        titles = tuple(name or f"object {place}" for place, name in enumerate(names))
        labels[OBJECT] = Labels(titles, np.repeat(np.arange(len(names)), sizes))
    layers: dict[str, Layer] = {}
    if (colour >= 0).any():
        layers[COLOUR] = Layer(np.array(package.colours, dtype=np.uint8), colour)
    if package.materials:
        known_as = {
            name: place for place, name in enumerate(dict.fromkeys(package.materials.values()))
        }
        number = np.full(len(package.colours) + 1, NONE)
        number[[*package.materials]] = [known_as[name] for name in package.materials.values()]
        labels[MATERIAL] = Labels(tuple(known_as), number[colour.reshape(-1, 3)[:, 0]])
    offsets = np.arange(0, len(corners) + 1, 3)
    return MeshFile(
        np.concatenate(points),
        offsets,
        corners,
        layers,
        labels=labels,
        double=True,
        changes=dropped(package.lost),
        unit=package.unit,
    )


def _placed_faces(package: _Package) -> int:
    """Count the triangles that the build places. Raises UnreadableError."""
    counts: dict[Key, int] = {}

    def count(key: Key, above: tuple[Key, ...]) -> int:
        if key in above or len(above) > 100:
            raise UnreadableError(f"object {key[1]} of the 3MF file is a part of itself")
        if key not in package.objects:
            raise UnreadableError(f"the 3MF file has no object {key[1]} in {key[0]}")
        if key not in counts:
            own = package.objects[key]
            inner = sum(count(each, (*above, key)) for each, _ in own.components)
            # A copy without triangles takes its time too.
            counts[key] = 1 + len(own.triangles) // _TRIANGLE + inner
        return counts[key]

    return sum(count(key, ()) for key, _ in package.items)


def _placements(package: _Package) -> Iterator[Placed]:
    """Yield the objects of triangles that are printed, and where."""
    pending = list(reversed(package.items))
    while pending:
        key, matrix = pending.pop()
        own = package.objects[key]
        if len(own.triangles):
            yield key, matrix
        for inner, place in reversed(own.components):
            moved = place @ matrix[:3]
            moved[3] += matrix[3]
            pending.append((inner, moved))


def _arrays(
    package: _Package, key: Key
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"], Int[np.ndarray, "F 3"]]:
    """Return the points of an object, its triangles, and the colours of their corners."""
    own = package.objects[key]
    points = np.array(own.points).reshape(-1, 3)
    table = np.array(own.triangles).reshape(-1, _TRIANGLE)
    faces, group, index = table[:, :3], table[:, 3], table[:, 4:]
    wrong = np.flatnonzero(((faces < 0) | (faces >= len(points))).any(axis=1))
    if len(wrong):
        face = wrong[0]
        raise UnrefinableError(
            f"triangle {face} of object {key[1]} in {key[0]} names vertices "
            f"{', '.join(map(str, faces[face]))}, expected 0 … {len(points) - 1}"
        )
    colours = np.full(index.shape, NONE)
    for number in np.unique(group[group >= 0]).tolist():
        here = np.flatnonzero(group == number)
        begin, count = package.groups.get((key[0], str(number)), (0, 0))
        known = here[((index[here] >= 0) & (index[here] < count)).all(axis=1)]
        colours[known] = begin + index[known]
        package.lost["properties that are no colours"] += len(here) - len(known)
    return points, faces, colours


def write_3mf(mesh: MeshFile) -> bytes:
    """Write a package: an object for each that the mesh names, all where they are.

    A material is as many base materials as it has faces of one colour; faces of several colours
    have these alone.
    """
    file = BytesIO()
    with zipfile.ZipFile(file, "w") as package:
        for name, pieces in (
            ("[Content_Types].xml", [_TYPES.encode()]),
            ("_rels/.rels", [_RELATIONS.encode()]),
            (_ROOT, _model_of(mesh)),
        ):
            entry = zipfile.ZipInfo(name, _WRITTEN)
            entry.compress_type = zipfile.ZIP_DEFLATED
            with package.open(entry, "w") as part:
                for piece in pieces:
                    part.write(piece)
    return file.getvalue()


def _model_of(mesh: MeshFile) -> Iterator[bytes]:
    groups, tables = _groups_of(mesh)
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<model unit="{mesh.unit or UNIT}" xmlns="{_CORE}" xmlns:m="{_MATERIAL}">\n<resources>\n'
        f"{''.join(groups)}"
    ).encode()
    items: list[str] = []
    for number, (name, chosen, vertices, corners) in enumerate(_objects_of(mesh), start=3):
        title = f" name={quoteattr(name)}" if name else ""
        yield f'<object id="{number}" type="model"{title}><mesh><vertices>\n'.encode()
        form = f'<vertex x="{NUMBER}" y="{NUMBER}" z="{NUMBER}"/>\n'
        yield from rows_text(form, mesh.vertices[vertices])
        yield b"</vertices><triangles>\n"
        yield from _triangles_text(corners, tables[chosen])
        yield b"</triangles></mesh></object>\n"
        items.append(f'<item objectid="{number}"/>\n')
    yield f"</resources>\n<build>\n{''.join(items)}</build>\n</model>\n".encode()


def vertices_of_objects(mesh: MeshFile) -> Int[np.ndarray, " W"]:
    """Return the vertex that each one of a written package is."""
    return np.concatenate([vertices for _, _, vertices, _ in _objects_of(mesh)])


def _objects_of(
    mesh: MeshFile,
) -> Iterator[tuple[str, Int[np.ndarray, " f"], Int[np.ndarray, " v"], Int[np.ndarray, "f 3"]]]:
    """Yield each object's name, its faces, its vertices, and its faces by the numbers of these."""
    labels = mesh.labels.get(OBJECT)
    of_face = np.zeros(len(mesh.faces), dtype=np.int64) if labels is None else labels.of_face
    for label in np.unique(of_face).tolist():
        chosen = np.flatnonzero(of_face == label)
        flat = mesh.faces[chosen].reshape(-1)
        corners, first = number_by_first_appearance(flat)
        name = "" if labels is None or label < 0 else labels.names[label]
        yield name, chosen, flat[first], corners.reshape(-1, 3)


def _groups_of(mesh: MeshFile) -> tuple[list[str], Int[np.ndarray, "F 4"]]:
    """Return the groups of properties as text, and for each face its group and its corners' rows.

    Group 1 are materials, group 2 colours; 0 is none.
    """
    table = np.zeros((len(mesh.faces), 4), dtype=np.int64)
    rows, shown = _colour_rows(mesh)
    table[(rows >= 0).all(axis=1), 0] = 2
    table[:, 1:] = rows
    groups: list[str] = []
    labels = mesh.labels.get(MATERIAL)
    if labels is not None:
        own = np.flatnonzero((labels.of_face >= 0) & is_of_one_colour(rows))
        kinds, number = np.unique(
            np.stack([labels.of_face[own], rows[own, 0]], axis=1), axis=0, return_inverse=True
        )
        table[own, 0], table[own, 1:] = 1, number.reshape(-1, 1)
        groups += ['<basematerials id="1">\n'] if len(kinds) else []
        for name, row in kinds.tolist():
            colour = _hex(shown[row]) if row >= 0 else _WHITE
            title = quoteattr(labels.names[name])
            groups.append(f"<base name={title} displaycolor={colour}/>\n")
        groups += ["</basematerials>\n"] if len(kinds) else []
    if (table[:, 0] == 2).any():
        groups.append('<m:colorgroup id="2">\n')
        groups += [f"<m:color color={_hex(colour)}/>\n" for colour in shown]
        groups.append("</m:colorgroup>\n")
    return groups, table


def faces_of_several_colours(mesh: MeshFile) -> int:
    """Count the faces that have a material and several colours: they are written without it."""
    labels = mesh.labels.get(MATERIAL)
    if labels is None:
        return 0
    return int(((labels.of_face >= 0) & ~is_of_one_colour(_colour_rows(mesh)[0])).sum())


def is_of_one_colour(rows: Int[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    """Return which faces have one colour, or none."""
    alike: Bool[np.ndarray, " F"] = (rows == rows[:, :1]).all(axis=1)
    return alike


def _colour_rows(
    mesh: MeshFile,
) -> tuple[Int[np.ndarray, "F 3"], UInt8[np.ndarray, "N 4"]]:
    """Return the colour of each corner, or NONE, and the distinct colours."""
    layer = mesh.layers.get(COLOUR)
    if layer is None:
        return np.full(mesh.faces.shape, NONE), np.zeros((0, 4), dtype=np.uint8)
    wide = np.ones((len(layer.values), 4))
    wide[:, : layer.values.shape[1]] = as_fractions(layer.values)
    rgba = np.rint(255 * np.clip(wide, 0, 1)).astype(np.uint8)
    row = distinct_rows(rgba)
    _, first = np.unique(row, return_index=True)
    return np.append(row, NONE)[layer.rows].reshape(-1, 3), rgba[first]


def _hex(colour: UInt8[np.ndarray, " 4"]) -> str:
    return f'"#{colour.tobytes().hex().upper()}"'


def _triangles_text(
    faces: Int[np.ndarray, "F 3"], table: Int[np.ndarray, "F 4"]
) -> Iterator[bytes]:
    """Write triangles in their order; those that follow each other with one group together."""
    vertices = '<triangle v1="%d" v2="%d" v3="%d"'
    forms = {
        0: vertices + "/>\n",
        1: vertices + ' pid="1" p1="%d"/>\n',
        2: vertices + ' pid="2" p1="%d" p2="%d" p3="%d"/>\n',
    }
    turns = np.flatnonzero(np.diff(table[:, 0])) + 1
    for begin, end in pairwise([0, *turns.tolist(), len(faces)]):
        group = int(table[begin, 0])
        shown = table[begin:end, 1 : 1 + {0: 0, 1: 1, 2: 3}[group]]
        yield from rows_text(forms[group], np.hstack([faces[begin:end], shown]))
