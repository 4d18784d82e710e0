"""The formats of plain meshes: how each is read and written, and what it can hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.mesh.mesh import fans
from pns_common.mesh.rows import distinct_rows, first_places, marked

from ..changes import Change, counted
from ..errors import UnreadableError, UnrefinableError
from ..gltf.read.plan import check_memory
from ..gltf.refine.changes import STEPS, faces_too_far
from ..options import Limits
from .mesh_file import (
    COLOUR,
    GROUP,
    MATERIAL,
    NORMAL,
    OBJECT,
    SMOOTHING,
    UV,
    Layer,
    MeshFile,
    as_fractions,
    shown,
)
from .obj import read_obj, write_obj
from .off import is_binary, read_off, write_off
from .parts import LARGEST, with_vertex_layers
from .ply import read_ply, write_ply
from .stl import is_text, read_stl, write_stl
from .text import count_words
from .threemf import (
    UNIT,
    faces_of_several_colours,
    read_3mf,
    unpacked_size,
    vertices_of_objects,
    write_3mf,
)
from .triangulate import triangulated


@dataclass(frozen=True)
class Format:
    """A format: what it can hold, and what reading takes.

    Attributes:
        layers: those of corners; None: any.
        vertex_layers: those of which a vertex has one value.
        face_values, labels: those of faces; None: any.
        double: whether positions keep more digits than float32 has.
        triangles: whether other polygons are cut.
        partial: layers that some corners may lack.
        order: the vertex that each one of a written file is.
        unit: whether it says of what unit lengths are.
        binary: bytes of a file that are no text, unpacked.
        bytes_per_byte: memory that reading takes for each of these.
    """

    read: Callable[[bytes], MeshFile]
    write: Callable[[MeshFile], bytes]
    binary: Callable[[bytes], int] = lambda data: 0
    bytes_per_byte: int = 0
    layers: frozenset[str] | None = frozenset()
    vertex_layers: frozenset[str] | None = frozenset()
    face_values: frozenset[str] | None = frozenset()
    labels: frozenset[str] = frozenset()
    double: bool = False
    triangles: bool = False
    partial: frozenset[str] = frozenset()
    order: Callable[[MeshFile], Int[np.ndarray, " W"]] = lambda mesh: np.arange(len(mesh.vertices))
    unit: bool = False


FORMATS = {
    "obj": Format(
        read_obj,
        write_obj,
        layers=frozenset({UV, NORMAL, COLOUR}),
        vertex_layers=frozenset({COLOUR}),
        labels=frozenset({MATERIAL, GROUP, OBJECT, SMOOTHING}),
        double=True,
        partial=frozenset({UV, NORMAL}),
    ),
    "off": Format(
        read_off,
        write_off,
        lambda data: len(data) * is_binary(data),
        bytes_per_byte=60,
        layers=frozenset({UV, NORMAL, COLOUR}),
        vertex_layers=None,
        face_values=frozenset({COLOUR}),
        double=True,
    ),
    "ply": Format(
        read_ply,
        write_ply,
        lambda data: len(data) * (b"ascii" not in data[:200]),
        bytes_per_byte=150,
        layers=None,
        vertex_layers=None,
        face_values=None,
    ),
    "stl": Format(
        read_stl,
        write_stl,
        lambda data: len(data) * (not is_text(data)),
        bytes_per_byte=12,
        triangles=True,
        order=lambda mesh: mesh.corners,
    ),
    "3mf": Format(
        read_3mf,
        write_3mf,
        unpacked_size,
        bytes_per_byte=10,
        layers=frozenset({COLOUR}),
        face_values=frozenset(),
        labels=frozenset({MATERIAL, OBJECT}),
        double=True,
        triangles=True,
        partial=frozenset({COLOUR}),
        order=vertices_of_objects,
        unit=True,
    ),
}

OF_TRIANGLES = frozenset(kind for kind, form in FORMATS.items() if form.triangles)


def memory_to_read(data: bytes, kind: str) -> int:
    """Predict the bytes that reading takes at its peak, erring upwards.

    A text takes them by its letters, its lines and its words, measured on the shortest of each.
    """
    form = FORMATS[kind]
    if size := form.binary(data):
        return form.bytes_per_byte * size
    lines = data.count(b"\n") + data.count(b"\r")
    return 8 * len(data) + 170 * lines + 130 * count_words(data)


def read(data: bytes, kind: str) -> MeshFile:
    """Read a mesh file as triangles. Raises as `read_polygons`."""
    return triangulated(read_polygons(data, kind))


def read_polygons(data: bytes, kind: str) -> MeshFile:
    """Read a mesh file with its polygons as they are.

    Raises:
        UnreadableError: not a file of this kind, or one without faces, or without all of them.
        UnrefinableError: a face names a vertex that there is not, or that is nowhere.
    """
    mesh = FORMATS[kind].read(data)
    count = len(mesh.vertices)
    proper = mesh.sizes >= 3
    if not proper.all():
        told = {"few-corners": int((~proper).sum())}
        mesh = mesh.of_faces(proper).with_changes(counted(told))
    if len(mesh.corners) == 0:
        raise UnreadableError(f"the {kind.upper()} file has no faces of three vertices")
    if not (mesh.corners.min() >= 0 and mesh.corners.max() < count):
        wrong = (mesh.corners < 0) | (mesh.corners >= count)
        place = int(np.argmax(wrong))
        face = int(np.searchsorted(mesh.offsets, place, "right")) - 1
        raise UnrefinableError(
            f"face {face} of the {kind.upper()} file names vertex {mesh.corners[place]}, "
            f"expected 0 … {count - 1}"
        )
    used = marked(mesh.corners, count)
    wrong = np.flatnonzero(used & ~np.isfinite(mesh.vertices).all(axis=1))
    if len(wrong):
        raise UnrefinableError(
            f"vertex {wrong[0]} of the {kind.upper()} file has a coordinate that is NaN or infinite"
        )
    unused = count - int(np.count_nonzero(used))
    return mesh.with_changes(counted({"unused-vertices": unused}))


def read_within(data: bytes, kind: str, limits: Limits) -> MeshFile:
    """Read a mesh file, if reading takes no more memory than it may.

    Raises as `read_polygons`, and LimitError.
    """
    check_memory(memory_to_read(data, kind), limits)
    return read_polygons(data, kind)


def write(mesh: MeshFile, kind: str) -> bytes:
    """Write the file's bytes, of OBJ and OFF as text; what it cannot hold is lost."""
    return FORMATS[kind].write(held(mesh, kind)[0])


def held(mesh: MeshFile, kind: str) -> tuple[MeshFile, list[Change]]:
    """Return what a format can hold of a mesh, and what it cannot.

    Raises:
        UnrefinableError: a position beyond the range of float32, where that is all it holds.
    """
    form, lost = FORMATS[kind], dict[str, int]()
    mesh = triangulated(mesh) if form.triangles else mesh
    layers = {
        name: layer
        for name, layer in mesh.layers.items()
        if (form.layers is None or name in form.layers)
        and ((layer.rows >= 0).all() or name in form.partial)
    }
    for name in mesh.layers.keys() - layers.keys():
        partly = form.layers is None or name in form.layers
        lost[shown(name) + " that not all corners have" * partly] = 1
    if COLOUR in layers and layers[COLOUR].values.dtype.itemsize == 2:
        # Whole numbers are bytes to readers of these formats.
        words = as_fractions(layers[COLOUR].values).astype(np.float32)
        layers[COLOUR] = replace(layers[COLOUR], values=words)
    if kind == "obj" and COLOUR in layers:
        if len(layers[COLOUR].values) > len(mesh.vertices):  # else vertices stay one
            layers[COLOUR] = _each_once(layers[COLOUR])
        colours = as_fractions(layers[COLOUR].values)
        if (colours[:, 3:] < 1).any():
            lost["opacity of vertex colours"] = 1
    if kind == "3mf":
        lost["materials of faces of several colours"] = faces_of_several_colours(mesh)
    # What says nothing of it is taken for millimetres.
    if mesh.unit not in ("", UNIT) and not form.unit:
        lost[f"unit of lengths, {mesh.unit},"] = 1
    values = {
        name: column
        for name, column in mesh.face_values.items()
        if form.face_values is None or name in form.face_values
    }
    lost |= {
        "colours of faces" if name == COLOUR else f"face property {name}": 1
        for name in mesh.face_values.keys() - values.keys()
    }
    labels = {name: label for name, label in mesh.labels.items() if name in form.labels}
    lost |= {
        f"{name}s": len(mesh.labels[name].names) for name in mesh.labels.keys() - labels.keys()
    }
    libraries = mesh.libraries if MATERIAL in form.labels else ()
    textures = mesh.textures if kind == "ply" else ()
    lost["names of textures"] = len(mesh.textures) - len(textures)
    told = {("not-written", what, kind.upper()): count for what, count in sorted(lost.items())}
    changes = counted(told)
    held = replace(mesh, layers=layers, face_values=values, labels=labels)
    mesh = replace(held, libraries=libraries, textures=textures)
    names = form.vertex_layers
    mesh = with_vertex_layers(mesh, [*layers] if names is None else [*names])
    if not (form.double or (kind == "ply" and mesh.double)):
        changes += rounding_changes(mesh)
    return mesh, changes


def _each_once(layer: Layer) -> Layer:
    """Return a layer whose rows are equal where its values are, in single precision."""
    number = distinct_rows(layer.values.astype(np.float32))
    first = first_places(number, int(number.max(initial=-1)) + 1)
    return Layer(layer.values[first], number[layer.rows])


def rounding_changes(mesh: MeshFile) -> list[Change]:
    """Count the faces to which float32 leaves no area, and those to which it leaves few steps.

    Raises:
        UnrefinableError: a position beyond the range of float32.
    """
    if np.abs(mesh.vertices).max() > LARGEST:
        raise UnrefinableError("positions leave the range of float32; write an OBJ or OFF file")
    triangles = (mesh.sizes == 3).all()
    faces = mesh.faces if triangles else mesh.corners[fans(mesh.offsets)[0]]
    rounded, flat = mesh.vertices.astype(np.float32), 0
    if not np.array_equal(rounded, mesh.vertices):
        flat = int((_without_area(rounded, faces) & ~_without_area(mesh.vertices, faces)).sum())
    far = faces_too_far(mesh.vertices, faces)
    return counted({"rounded-flat": flat, ("rounded-far", str(STEPS)): far})


def _without_area(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Bool[np.ndarray, " F"]:
    """Return which faces have two corners in one place."""
    a, b, c = (vertices[column] for column in faces.T)
    return (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
