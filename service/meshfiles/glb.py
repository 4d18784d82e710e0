"""A mesh as a GLB: one node, one mesh, a primitive for each material.

Quads become pairs of triangles that FB_ngon_encoding says how to join again.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Int

from ..bodies.sibling_files import Opened, SiblingFiles
from ..changes import Change, counted, with_changes
from ..gltf.constants import COMPONENT_TYPES, FLOAT, NGONS, UNSIGNED_INT
from ..gltf.read.container import decode_object, encode, read_glb, write_glb
from ..gltf.read.resources import embed_images
from ..gltf.read.schema import Accessor, view
from ..gltf.refine.attributes import Columns, RefinedPrimitive
from ..gltf.write.compression import WRITERS
from ..gltf.write.storage import put_report
from ..gltf.write.writer import Writer
from ..options import Limits, Options
from ..stages import Stages
from .formats import rounding_changes
from .mesh_file import COLOUR, MATERIAL, NONE, NORMAL, UV, Labels, Layer, MeshFile
from .mtl import PLAIN, WHITE, library_files, materials_of, textured
from .parts import Part, kinds_of, parts_of
from .threemf import METRES
from .triangulate import triangulated

_SHAPES: tuple[Literal["SCALAR", "VEC2", "VEC3", "VEC4"], ...] = ("SCALAR", "VEC2", "VEC3", "VEC4")
# Which corners of a quad its two triangles have, by the corner that both begin with.
FANS = np.array([[k, (k + 1) % 4, (k + 2) % 4, k, (k + 2) % 4, (k + 3) % 4] for k in range(4)])
# From z upwards, as a printer has it, to y upwards.
UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
_STORED = {dtype for number, dtype in COMPONENT_TYPES.items() if number != UNSIGNED_INT}


def as_glb(
    mesh: MeshFile,
    report: dict[str, Any],
    options: Options,
    siblings: SiblingFiles,
    stages: Stages,
) -> tuple[bytes, dict[str, Any]]:
    """Write refined triangles or quads; return also the report, with what is lost.

    Where other polygons are among quads, all are cut into triangles.

    Materials are read from the libraries that came with the file, or lie beside it.

    Raises:
        UnrefinableError: a position that float32 cannot hold.
    """
    changes, opened = rounding_changes(mesh), Opened(siblings)
    if mesh.textures and UV not in mesh.layers:
        changes += counted({"no-coordinates": len(mesh.textures)})
    mesh = _with_textures(mesh)
    mesh, lost = _with_colours_at_corners(mesh)
    changes += lost
    quads = bool((mesh.sizes == 4).all())
    parts, incomplete = parts_of(_as_triangles(mesh) if quads else triangulated(mesh))
    labels = mesh.labels.get(MATERIAL)
    names = () if labels is None else labels.names
    if mesh.textures:
        made = textured(names, opened)
    else:
        made = materials_of(names, mesh.libraries, mesh.encoding, opened)
    changes += _not_written(
        {f"{keyword} of materials": made.lost[keyword] for keyword in made.lost}
    )
    missing = [name for name in mesh.libraries if not library_files(name, opened)]
    changes += incomplete + counted({("no-library", name): 1 for name in missing})
    materials = [*made.entries, {"pbrMetallicRoughness": PLAIN}]
    shown = [_shown(part, materials) for part in parts]
    if all(part.material != len(materials) - 1 for part in shown):
        materials.pop()
    tree = _tree(materials, mesh.unit)
    if made.images:
        tree["images"] = [{"uri": uri} for uri in made.images]
        tree["textures"] = [{"source": number} for number in range(len(made.images))]
    buffers: list[memoryview] = []
    changes += embed_images(tree, view(tree), buffers, opened)
    changes += counted({("unused-file", name): 1 for name in opened.unused})
    writer = WRITERS[options.compress].start(tree, buffers)
    # The first corner of a triangle counts.
    writer.in_order = quads
    ngons = quads and options.compress != "draco"
    vertices = _write_parts(writer, shown, stages, ngons=ngons)
    changes += writer.changes()
    if quads and not ngons:
        changes += counted({("ngons-reordered", NGONS): 1})
    totals = report["totals"] | {"primitives": len(shown), "vertices": vertices}
    report = with_changes(report | {"totals": totals}, changes)
    if options.diagnostics != "none":
        put_report(tree, report)
    pieces = writer.finish()
    return write_glb(encode(tree), pieces, []), report


def triangles_glb(mesh: MeshFile, *, material: dict[str, Any] | None = None) -> bytes:
    """Write triangles of one material."""
    materials = [] if material is None else [material]
    writer = Writer.start(_tree(materials), [])
    parts = [replace(part, material=len(materials) - 1) for part in parts_of(mesh)[0]]
    _write_parts(writer, parts, Stages())
    pieces = writer.finish()
    return write_glb(encode(writer.tree), pieces, [])


def _tree(materials: Sequence[dict[str, Any]], unit: str = "") -> dict[str, Any]:
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "pns"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"mesh": 0} | ({"rotation": UPRIGHT, "scale": 3 * [METRES[unit]]} if unit else {})
        ],
    }
    return tree | ({"materials": list(materials)} if materials else {})


def _write_parts(
    writer: Writer, parts: Sequence[Part], stages: Stages, *, ngons: bool = False
) -> int:
    """Write the only mesh; return the number of its vertices."""
    entry = {"extensions": {NGONS: {}}} if ngons else {}
    writer.tree["meshes"] = [
        {"primitives": [_named(part.material) | entry for part in parts]},
    ]
    if ngons:
        writer.tree["extensionsUsed"] = [NGONS]
    return writer.replace_mesh(0, [_stored_part(part) for part in parts], stages)


def _named(material: int) -> dict[str, Any]:
    return {} if material == NONE else {"material": material}


def _stored_part(part: Part) -> RefinedPrimitive:
    """Return a part's geometry under the names, and in the types, of a glTF."""
    attributes, accessors = Columns(), dict[str, Accessor]()
    for layer, values in part.primitive.attributes.items():
        name, column = attribute_name(layer), _stored(layer, values)
        fraction = layer == COLOUR and column.dtype.kind in "ui"
        shape = _SHAPES[column.shape[1] - 1]
        attributes[name] = column
        accessors[name] = Accessor(FLOAT, len(column), shape, normalized=fraction)
    source = replace(part.primitive, accessors=accessors)
    return RefinedPrimitive(source, part.primitive.corners, attributes, [])


def attribute_name(layer: str) -> str:
    """Return how a glTF calls a layer: its own names are in capitals, behind an underscore."""
    if not layer.startswith("_"):
        return layer
    return "_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in layer[1:]).upper()


def _stored(name: str, values: np.ndarray) -> np.ndarray:
    """Return a layer's values as a glTF holds them: floats are single, v counts downwards."""
    if name == UV:
        values = np.column_stack([values[:, 0], 1 - values[:, 1]])
    if name in ("POSITION", NORMAL, UV) or values.dtype not in _STORED:
        return values.astype(np.float32)
    return values


def as_gltf_json(glb: bytes, limits: Limits) -> bytes:
    """Return the same file as a .gltf whose buffer is embedded as a data: URI."""
    container = read_glb(glb)
    tree = decode_object(container.text, limits)
    if container.binary is not None:
        length = tree["buffers"][0]["byteLength"]
        content = base64.b64encode(container.binary[:length]).decode()
        tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{content}"
    return encode(tree)


def _shown(part: Part, materials: list[dict[str, Any]]) -> Part:
    """Return a part with the plain material where it has none; what is coloured is white below."""
    if part.material == NONE:
        part = replace(part, material=len(materials) - 1)
    if COLOUR in part.primitive.attributes:
        surface = materials[part.material]["pbrMetallicRoughness"]
        if surface["baseColorFactor"] == PLAIN["baseColorFactor"]:
            surface = surface | {"baseColorFactor": WHITE}
            materials[part.material] = materials[part.material] | {"pbrMetallicRoughness": surface}
    return part


def _not_written(counts: dict[str, int]) -> list[Change]:
    return counted({("not-written", what, "GLB"): count for what, count in counts.items()})


def _with_colours_at_corners(mesh: MeshFile) -> tuple[MeshFile, list[Change]]:
    """Return faces' colours as their corners', which is all that a glTF has; return what goes."""
    lost = {f"face property {name}": len(own) for name, own in mesh.face_values.items()}
    if lost.pop(f"face property {COLOUR}", 0) and COLOUR in mesh.layers:
        lost["colours of faces, as vertices have some,"] = len(mesh.sizes)
    lost |= {f"{kind}s": len(own.names) for kind, own in mesh.labels.items() if kind != MATERIAL}
    changes = _not_written(lost)
    colours = mesh.face_values.get(COLOUR)
    if colours is None or COLOUR in mesh.layers:
        return mesh, changes
    rows = np.repeat(np.arange(len(colours)), mesh.sizes)
    return replace(mesh, layers={**mesh.layers, COLOUR: Layer(colours, rows)}), changes


def _with_textures(mesh: MeshFile) -> MeshFile:
    """Return a mesh with materials by the numbers of its textures, as MeshLab writes them.

    It names no texture if it has no texture coordinates, or no number.
    """
    if not mesh.textures or UV not in mesh.layers:
        return replace(mesh, textures=())
    of_face, values = np.zeros(len(mesh.sizes), dtype=np.int64), dict(mesh.face_values)
    if (own := values.pop("texnumber", None)) is not None:
        of_face = own[:, 0].astype(np.int64)
        of_face[(of_face < 0) | (of_face >= len(mesh.textures))] = NONE
    labels = {**mesh.labels, MATERIAL: Labels(mesh.textures, of_face)}
    return replace(mesh, face_values=values, labels=labels)


def _as_triangles(mesh: MeshFile) -> MeshFile:
    """Return quads as triangles, those of a primitive together, as FB_ngon_encoding asks for.

    Triangles of one quad begin with one vertex, and those of the next with another.
    """
    order = np.argsort(kinds_of(mesh), kind="stable")
    begin = _beginnings(mesh.corners.reshape(-1, 4)[order])
    places = (4 * order[:, None] + FANS[begin]).reshape(-1)
    return mesh.cut(places.reshape(-1, 3), np.repeat(order, 2))


def _beginnings(quads: Int[np.ndarray, "F 4"]) -> Int[np.ndarray, " F"]:
    """Return a corner of each quad, none at the vertex of the one before it."""
    begin = np.zeros(len(quads), dtype=np.int64)
    rows = np.arange(len(quads))
    while True:
        first = quads[rows, begin]
        alike = np.flatnonzero(first[1:] == first[:-1]) + 1
        if not len(alike):
            return begin
        # Every second of a run: those beside it stay.
        turned = alike[np.append(True, np.diff(alike) > 1)]
        begin[turned] = (begin[turned] + 1) % 4
