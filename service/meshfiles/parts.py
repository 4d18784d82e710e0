"""Triangles as the primitives that the pipeline refines, one for each material, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Int

from pns_common.mesh.rows import (
    distinct_rows,
    first_places,
    marked,
    number_by_first_appearance,
    unit,
)
from pns_common.schemes.matrix import SubdivisionMatrix

from ..changes import Change
from ..gltf.constants import FLOAT
from ..gltf.read.primitives import TrianglePrimitive
from ..gltf.read.schema import Accessor
from ..gltf.refine.attributes import RefinedPrimitive
from ..gltf.refine.selection import check_chosen
from ..meshes.weld import canonical_zero
from ..options import Options
from .mesh_file import (
    GROUP,
    MATERIAL,
    NONE,
    NORMAL,
    OBJECT,
    SMOOTHING,
    Labels,
    Layer,
    MeshFile,
    dropped,
    joined_layer,
    shown,
)
from .triangulate import area_vectors

LARGEST = float(np.finfo(np.float32).max)
_SMOOTH_OFF = frozenset({"off", "0", ""})


@dataclass(frozen=True, eq=False)
class Part:
    """The triangles of one material.

    Attributes:
        primitive: their vertices; positions are doubles.
        faces: (F,) which triangles of the file they are.
        material: its number among the names of materials; NONE where there is none.
    """

    primitive: TrianglePrimitive
    faces: Int[np.ndarray, " F"]
    material: int


def chosen_of(mesh: MeshFile, options: Options) -> Bool[np.ndarray, " F"] | None:
    """Return which faces the options choose by their names; None where all are.

    Raises:
        UnrefinableError: none is chosen.
    """
    if not options.selects:
        return None
    chosen = np.ones(len(mesh.sizes), dtype=bool)
    wanted = ((options.material, (MATERIAL,)), (options.group, (GROUP, OBJECT)))
    names: list[set[str]] = []
    for name, kinds in wanted:
        labels = [mesh.labels[kind] for kind in kinds if kind in mesh.labels]
        names.append({each for label in labels for each in label.names})
        if name is not None:
            own = [np.zeros_like(chosen)]
            own += [label.named(name, words=GROUP in kinds) for label in labels]
            chosen &= np.any(own, axis=0)
    check_chosen(options, bool(chosen.any()), [*names[0]], names[1])
    return chosen


def parts_of(mesh: MeshFile) -> tuple[list[Part], list[Change]]:
    """Divide triangles by material and by the layers that they have, in the order of the file.

    Values that float32 cannot hold are dropped and reported.
    """
    materials = mesh.labels.get(MATERIAL)
    count = len(mesh.faces)
    order, first = number_by_first_appearance(kinds_of(mesh))
    parts: list[Part] = []
    lost: dict[str, int] = {}
    for number, place in enumerate(first.tolist()):
        faces = np.arange(count) if len(first) == 1 else np.flatnonzero(order == number)
        material = NONE if materials is None else int(materials.of_face[place])
        primitive = _primitive(mesh, faces, number, lost)
        parts.append(Part(primitive, faces, material))
    return parts, [*dropped(lost)]


def kinds_of(mesh: MeshFile) -> Int[np.ndarray, " F"]:
    """Return labels that faces share if they have one material and the same layers."""
    materials = mesh.labels.get(MATERIAL)
    kind = np.zeros(len(mesh.sizes), dtype=np.int64) if materials is None else materials.of_face + 1
    for layer in mesh.layers.values():
        kind = 2 * kind + np.logical_and.reduceat(layer.rows >= 0, mesh.offsets[:-1])
    return kind


def _primitive(
    mesh: MeshFile, faces: Int[np.ndarray, " F"], number: int, lost: dict[str, int]
) -> TrianglePrimitive:
    corners = (3 * faces[:, None] + np.arange(3)).reshape(-1)
    layers: dict[str, Layer] = {}
    for name, layer in mesh.layers.items():
        rows = layer.rows[corners]
        if (rows < 0).any():
            continue
        if not (np.abs(layer.values) <= LARGEST).all():
            what = f"{shown(name)}, of which some are no numbers of float32,"
            lost[what] = lost.get(what, 0) + len(faces)
        else:
            layers[name] = Layer(layer.values, rows)
    vertex = mesh.corners[corners]
    row, first = number_by_first_appearance(corner_labels(vertex, layers))
    attributes = {"POSITION": mesh.vertices[vertex[first]]}
    for name, layer in layers.items():
        values = layer.values[layer.rows[first]]
        attributes[name] = unit(values).astype(np.float32) if name == NORMAL else values
    accessors = {
        # No more is asked of it but whether integers are fractions.
        name: Accessor(FLOAT, len(first), "SCALAR")
        for name in attributes
    }
    return TrianglePrimitive(number, vertex[first], row.reshape(-1, 3), attributes, accessors)


def corner_labels(vertex: Int[np.ndarray, " C"], layers: dict[str, Layer]) -> Int[np.ndarray, " C"]:
    """Return labels that corners share which have one vertex and one row of each layer."""
    columns = [vertex]
    for layer in layers.values():
        if not any(np.array_equal(layer.rows, column) for column in columns):
            columns.append(layer.rows)
    if all(_follows(column, columns[-1]) for column in columns[:-1]):
        return columns[-1]
    return number_by_first_appearance(distinct_rows(np.stack(columns, axis=1)))[0]


def _follows(column: Int[np.ndarray, " C"], other: Int[np.ndarray, " C"]) -> bool:
    """Return whether corners with one number in another column have one in this."""
    if (other < 0).any():
        return False
    of_other = np.zeros(int(other.max(initial=0)) + 1, dtype=column.dtype)
    of_other[other] = column
    return bool((of_other[other] == column).all())


def with_vertex_layers(mesh: MeshFile, names: Sequence[str]) -> MeshFile:
    """Return the mesh with a vertex for each value of some layers, as formats of vertices need."""
    layers = {name: layer for name, layer in mesh.layers.items() if name in names}
    if all(np.array_equal(layer.rows, mesh.corners) for layer in layers.values()):
        return mesh
    row = corner_labels(mesh.corners, layers)
    first = first_places(row, int(row.max(initial=-1)) + 1)
    if (first < 0).any():
        row, first = number_by_first_appearance(row)
    kept = {name: Layer(layer.values[layer.rows[first]], row) for name, layer in layers.items()}
    return replace(
        mesh,
        vertices=mesh.vertices[mesh.corners[first]],
        parents=None if mesh.parents is None else mesh.parents.take(mesh.corners[first]),
        corners=row,
        layers={**mesh.layers, **kept},
    )


def with_group_normals(mesh: MeshFile) -> MeshFile:
    """Return the mesh with normals that part where its smoothing groups do, if it has no others.

    Faces of one group share them; a face of none has its own. A file that names no group says
    nothing of its edges.
    """
    groups = mesh.labels.get(SMOOTHING)
    if groups is None or NORMAL in mesh.layers:
        return mesh
    smooth = np.array([name.lower() not in _SMOOTH_OFF for name in groups.names] + [False])
    if not smooth.any():
        return mesh
    of_face, sizes = groups.of_face, mesh.sizes
    points = distinct_rows(canonical_zero(mesh.vertices))[mesh.corners]
    label = np.where(smooth[of_face], of_face, len(groups.names) + np.arange(len(sizes)))
    corner = distinct_rows(np.stack([points, np.repeat(label, sizes)], axis=1))
    by_area, count = area_vectors(mesh), int(corner.max()) + 1
    sums = [np.bincount(corner, np.repeat(axis, sizes), minlength=count) for axis in by_area.T]
    return replace(mesh, layers={**mesh.layers, NORMAL: Layer(unit(np.stack(sums, 1)), corner)})


def joined(
    mesh: MeshFile,
    parts: Sequence[Part],
    kept: Sequence[Bool[np.ndarray, " F"]],
    refined: Sequence[RefinedPrimitive],
    parents: SubdivisionMatrix | None,
) -> MeshFile:
    """Return refined parts as one mesh, in the order of the file's faces.

    `kept` says for each part which of its faces were refined.
    """
    of_part = {part.primitive.number: (part, keep) for part, keep in zip(parts, kept, strict=True)}
    control = np.concatenate(
        [of_part[p.source.number][0].faces[of_part[p.source.number][1]] for p in refined]
    )
    counts = [p.counts for p in refined if p.counts is not None]
    ranks = np.repeat(control, np.concatenate(counts))
    order = slice(None) if len(refined) == 1 else np.argsort(ranks, kind="stable")
    ranks = ranks[order]

    ids = [primitive.vertex for primitive in refined if primitive.vertex is not None]
    used = np.flatnonzero(marked(np.concatenate(ids), 1 + max(int(own.max()) for own in ids)))
    ids = [np.searchsorted(used, own) for own in ids]
    vertices = np.empty((len(used), 3))
    for own, primitive in zip(ids, refined, strict=True):
        vertices[own] = primitive.attributes["POSITION"]
    corners = np.concatenate([own[p.faces] for own, p in zip(ids, refined, strict=True)])[order]
    layers: dict[str, Layer] = {}
    for name in dict.fromkeys(name for p in refined for name in p.attributes if name != "POSITION"):
        own = joined_layer([(p.attributes.get(name), p.faces.reshape(-1)) for p in refined])
        layers[name] = Layer(own.values, own.rows.reshape(-1, 3)[order].reshape(-1))
    labels = {
        kind: Labels(label.names, label.of_face[ranks]) for kind, label in mesh.labels.items()
    }
    return replace(
        mesh,
        vertices=vertices,
        offsets=np.arange(0, corners.size + 1, 3),
        corners=corners.reshape(-1).astype(np.int64),
        layers=layers,
        face_values={name: values[ranks] for name, values in mesh.face_values.items()},
        labels=labels,
        changes=(),
        tags=None,
        parents=None if parents is None else parents.take(used),
    )
