"""A mesh file as the GLB that says the same, for the one pipeline that refines glTF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..bodies.sibling_files import Opened, SiblingFiles
from ..bodies.uploads import Sent
from ..errors import UnrefinableError
from ..gltf.read.plan import check_memory
from ..options import Limits, Options
from ..report import Change
from . import formats
from .formats import rounding_changes
from .mesh_file import COLOUR, MATERIAL, NONE, Layer, MeshFile
from .mtl import PLAIN, WHITE, library_files, materials_of
from .parts import LARGEST, Part, chosen_of, parts_of, with_group_normals
from .triangles_glb import parts_glb


def as_gltf(
    mesh: MeshFile, siblings: SiblingFiles, options: Options, *, ngons: bool = False
) -> Sent:
    """Return triangles as a GLB, and what that lost.

    Materials are read from the libraries that came with the file, or lie beside it. `ngons` says
    that the triangles of a polygon follow each other, around its first corner.

    Raises:
        UnrefinableError: a position that float32 cannot hold.
    """
    if np.abs(mesh.vertices[mesh.corners]).max() > LARGEST:
        raise UnrefinableError("a position is beyond the range of float32")
    changes = [*mesh.changes]
    mesh, lost = _with_colours_at_corners(with_group_normals(mesh))
    chosen = chosen_of(mesh, options)
    parts, incomplete = parts_of(mesh, chosen)
    opened = Opened(siblings)
    labels = mesh.labels.get(MATERIAL)
    names = () if labels is None else labels.names
    made = materials_of(names, mesh.libraries, opened)
    changes += [
        Change("", f"materials not found: no {name} came with the file", 1)
        for name in mesh.libraries
        if not library_files(name, opened)
    ]
    materials = [*made.entries, {"pbrMetallicRoughness": PLAIN}]
    shown = [_shown(part, materials) for part in parts]
    if all(part.material != len(materials) - 1 for part in shown):
        materials.pop()
    glb = parts_glb(shown, materials, made.images, ngons=ngons)
    siblings = SiblingFiles(siblings.find, frozenset(opened.unused), siblings.folder)
    changes += [*lost, *incomplete, *_labels_lost(mesh), *rounding_changes(mesh)]
    refined = None
    if chosen is not None:
        refined = frozenset(p.primitive.number for p in parts if chosen[p.faces[0]])
    return Sent(glb, "glb", siblings, tuple(changes), refined)


def read_within(data: bytes, kind: str, limits: Limits) -> MeshFile:
    """Read a mesh file, if reading takes no more memory than it may.

    Raises as `formats.read_polygons`, and LimitError.
    """
    check_memory(formats.memory_to_read(data, kind), limits)
    return formats.read_polygons(data, kind)


def _shown(part: Part, materials: list[dict[str, Any]]) -> Part:
    """Return a part with the plain material where it has none; what is coloured is white below."""
    if part.material == NONE:
        part = replace(part, material=len(materials) - 1)
    if COLOUR in part.primitive.attributes:
        surface = materials[part.material]["pbrMetallicRoughness"]
        if surface["baseColorFactor"] == PLAIN["baseColorFactor"]:
            surface = {**surface, "baseColorFactor": WHITE}
            materials[part.material] = {
                **materials[part.material],
                "pbrMetallicRoughness": surface,
            }
    return part


def _with_colours_at_corners(mesh: MeshFile) -> tuple[MeshFile, list[Change]]:
    """Return faces' colours as their corners', which is all that a glTF has; other values go."""
    changes = [
        Change("", f"face property {name} dropped: not written to GLB files", len(values))
        for name, values in mesh.face_values.items()
        if name != COLOUR
    ]
    colours = mesh.face_values.get(COLOUR)
    if colours is None or COLOUR in mesh.layers:
        return mesh, changes
    rows = np.repeat(np.arange(len(colours)), 3)
    return replace(mesh, layers={**mesh.layers, COLOUR: Layer(colours, rows)}), changes


def _labels_lost(mesh: MeshFile) -> Iterator[Change]:
    for kind, label in mesh.labels.items():
        if kind != MATERIAL:
            yield Change("", f"{kind}s dropped: not written to GLB files", len(label.names))
