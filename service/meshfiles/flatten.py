"""A glTF scene as plain triangles, for formats that know no nodes; reports what is lost."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped, UInt8

from pns_common.mesh.rows import disjoint_faces, marked, unit

from ..changes import Change, counted
from ..errors import GltfError, UnrefinableError, check_limit
from ..gltf.constants import FLOAT, OUTLINE, SURFACES, TRIANGLES
from ..gltf.read.accessors import as_float, read
from ..gltf.read.extensions import INSTANCING
from ..gltf.read.primitives import TrianglePrimitive
from ..gltf.read.schema import Document
from ..gltf.read.upload import Upload
from ..gltf.refine.attributes import RefinedPrimitive
from ..gltf.refine.skin import read_skin_and_morph
from ..meshes.weld import weld
from ..options import Limits
from .formats import FORMATS, Format
from .mesh_file import (
    COLOUR,
    MATERIAL,
    NONE,
    NORMAL,
    OBJECT,
    UV,
    Labels,
    Layer,
    MeshFile,
    joined_layer,
    of_triangles,
)
from .pose import joint_matrices, posed

TRANSFORM, VISIBILITY = "KHR_texture_transform", "KHR_node_visibility"
LOST = ("textures", "images", "animations", "skins", "cameras", "extensions")
# Where a node stands that does not say.
UNMOVED = {
    "translation": np.zeros(3),
    "rotation": np.array([0.0, 0.0, 0.0, 1.0]),
    "scale": np.ones(3),
    "matrix": np.eye(4).reshape(-1),
}
# What placing a copy costs beside its faces, in faces; each joint of a skin costs one more.
COPY_COST = 100
_COPY_ATTRIBUTES = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


@dataclass(frozen=True, eq=False)
class Surface:
    """A primitive to place.

    Attributes:
        primitive: its triangles.
        vertex: (N,) the vertex of its mesh at each row; None: those in one place are one.
    """

    primitive: TrianglePrimitive
    vertex: Int[np.ndarray, " N"] | None = None

    @classmethod
    def of(cls, refined: RefinedPrimitive) -> Surface:
        """Return a refined primitive as one to place."""
        given, targets = refined.attributes, tuple(refined.targets)
        made = replace(refined.source, corners=refined.faces, attributes=given, targets=targets)
        return cls(made, refined.vertex)


def flatten(
    upload: Upload, surfaces: Mapping[int, Sequence[Surface]], kind: str, limits: Limits
) -> tuple[MeshFile, list[Change]]:
    """Return the default scene's triangles in the world, and what a file of `kind` is not given.

    `surfaces` are those of each mesh of the scene that has some.

    Raises:
        ServiceError: the scene shows no triangles, or cannot be placed.
        LimitError: the copies of its meshes have more than `max_faces`.
    """
    primitives = {mesh: own for mesh, own in surfaces.items() if own}
    faces = {
        mesh: sum(len(each.primitive.corners) for each in own) for mesh, own in primitives.items()
    }
    parents, hidden = _scene_nodes(upload.tree)
    shown = check_copies(upload, faces, limits)
    worlds = _world_matrices(upload.tree["nodes"], parents)
    placed, nodes, turned = list[MeshFile](), list[str](), 0
    for node, mesh in shown:
        weights = _shown_weights(upload.document, node, mesh)
        joints = joint_matrices(upload, node, worlds)
        shaded = any("NORMAL" in each.primitive.attributes for each in primitives[mesh])
        turned += shaded and joints is not None
        name = str(upload.tree["nodes"][node].get("name", f"node {node}"))
        for copy in _copies(upload, node):
            matrix = worlds[node] @ copy
            placed.append(_place(upload.tree, mesh, primitives[mesh], matrix, weights, joints))
            nodes.append(name)
    mesh_file = _joined(upload.tree, placed, nodes, FORMATS[kind])
    names = [set(s.primitive.attributes) for _, mesh in shown for s in primitives[mesh]]
    changes = _changes(upload.tree, len(placed), names, kind)
    left = {n for n, node in enumerate(upload.document.nodes) if node.mesh in primitives}
    # A format without normals has named them already.
    room = FORMATS[kind].layers
    turned *= room is None or NORMAL in room
    left_out = {
        "hidden nodes": len(left & hidden),
        "nodes outside of the default scene": len(left - worlds.keys()),
        "normals of skinned meshes": turned,
    }
    told = {("left-out", what): count for what, count in left_out.items()}
    return mesh_file, changes + counted(told, "/nodes")


def check_copies(upload: Upload, faces: Mapping[int, int], limits: Limits) -> list[tuple[int, int]]:
    """Check what it costs to place the copies of a scene's meshes, whose `faces` are known.

    Returns the nodes that show one, each with its mesh.

    Raises:
        ServiceError: the scene shows none, or copies that its accessors do not agree on.
        LimitError: the copies cost more than `max_faces`.
    """
    parents, hidden = _scene_nodes(upload.tree)
    shown, total = list[tuple[int, int]](), 0
    for number in parents:
        node = upload.document.nodes[number]
        if node.mesh is None or node.mesh not in faces or number in hidden:
            continue
        shown.append((number, node.mesh))
        joints = 0 if node.skin is None else len(upload.document.skins[node.skin].joints)
        cost = COPY_COST + joints + faces[node.mesh]
        total += cost * _copy_count(upload, number)
    if not shown:
        raise UnrefinableError("the default scene shows no triangles")
    text = f"the scene with all copies costs as much as {total} faces"
    check_limit("faces", total, limits.max_faces, text)
    return shown


def _copy_count(upload: Upload, node: int) -> int:
    """Return how many copies of its mesh a node shows.

    Raises:
        GltfError: the extension names no accessors, or some of different lengths.
    """
    counts = {upload.document.accessors[index].count for index in _copied(upload, node).values()}
    if len(counts) > 1:
        raise GltfError("copies need as many values of each kind", pointer=_pointer(node))
    return counts.pop() if counts else 1


def _copied(upload: Upload, node: int) -> dict[str, int]:
    """Return the accessors that place a node's copies, by name; none of a node without copies."""
    instances = upload.document.nodes[node].extensions.get(INSTANCING)
    if instances is None:
        return {}
    attributes = instances.get("attributes", {}) if isinstance(instances, dict) else None
    accessors = upload.document.accessors
    if not isinstance(attributes, dict) or not all(
        isinstance(index, int) and 0 <= index < len(accessors) for index in attributes.values()
    ):
        raise GltfError("attributes must name accessors", pointer=_pointer(node))
    for name, shape in _COPY_ATTRIBUTES.items():
        if name in attributes and accessors[attributes[name]].type != shape:
            raise GltfError(f"{name} must be {shape}", pointer=_pointer(node))
    return attributes


def _pointer(node: int) -> str:
    return f"/nodes/{node}/extensions/{INSTANCING}"


def _copies(upload: Upload, node: int) -> Float[np.ndarray, "N 4 4"]:
    """Return the matrices of a node's copies, in its own space: one that moves nothing without."""
    indices, count = _copied(upload, node), _copy_count(upload, node)
    if not indices:
        return np.eye(4)[None]
    values = {name: _floats(upload, indices[name]) for name in _COPY_ATTRIBUTES if name in indices}
    still, ones = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), np.ones((count, 3))
    quaternions = values.get("ROTATION", still)
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    quaternions = quaternions / np.where(lengths > 0, lengths, 1)
    moves = values.get("TRANSLATION", np.zeros((count, 3)))
    matrices = _placements(moves, quaternions, values.get("SCALE", ones))
    if not np.isfinite(matrices).all():
        raise GltfError("a copy is placed by NaN or infinity", pointer=_pointer(node))
    return matrices


def _floats(upload: Upload, index: int) -> Float[np.ndarray, "N K"]:
    accessor = upload.document.accessors[index]
    values = read(upload.document, upload.buffers, index)
    if accessor.component_type == FLOAT:
        return values.astype(np.float64)
    return as_float(values, normalized=accessor.normalized).astype(np.float64)


def _placements(
    moves: Float[np.ndarray, "N 3"],
    quaternions: Float[np.ndarray, "N 4"],
    scales: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 4 4"]:
    """Return matrices that scale, then rotate by quaternions x, y, z, w, then move."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrices = np.tile(np.eye(4), (len(moves), 1, 1))
    matrices[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * scales[:, None, :]
    matrices[:, :3, 3] = moves
    return matrices


def _scene_nodes(tree: dict[str, Any]) -> tuple[dict[int, int | None], set[int]]:
    """Return the parents of the default scene's nodes, in the order of its tree.

    And which of them are hidden, as all below a hidden one is.
    """
    nodes = tree.get("nodes", [])
    scenes = tree.get("scenes", [])
    children = set(_children(nodes))
    # A file without scenes shows the nodes without parents; their children stand where they do.
    parentless = [number for number in range(len(nodes)) if number not in children]
    roots = scenes[tree.get("scene", 0)].get("nodes", []) if scenes else parentless
    # A root that is a child too stands where its parent puts it: those without parents come first.
    ordered = sorted(roots, key=lambda root: root in children)
    pending: list[tuple[int, int | None]] = [(root, None) for root in reversed(ordered)]
    parents: dict[int, int | None] = {}
    hidden: set[int] = set()
    while pending:
        number, parent = pending.pop()
        # Once, whatever its parents: n nodes that are twice among the children of one are 2^n.
        if number in parents:
            continue
        parents[number] = parent
        if parent in hidden or _is_hidden(nodes[number]):
            hidden.add(number)
        pending += [(child, number) for child in reversed(nodes[number].get("children", []))]
    return parents, hidden


def _world_matrices(
    nodes: list[dict[str, Any]], parents: dict[int, int | None]
) -> dict[int, Float[np.ndarray, "4 4"]]:
    """Return where each node stands; parents come before their children. Raises GltfError."""
    worlds: dict[int, Float[np.ndarray, "4 4"]] = {}
    local = _local_matrices(nodes, parents.keys())
    for (number, parent), matrix in zip(parents.items(), local, strict=True):
        worlds[number] = (np.eye(4) if parent is None else worlds[parent]) @ matrix
    return worlds


def _is_hidden(node: dict[str, Any]) -> bool:
    visibility = node.get("extensions", {}).get(VISIBILITY)
    return isinstance(visibility, dict) and visibility.get("visible") is False


def _children(nodes: list[dict[str, Any]]) -> list[int]:
    """Return every mention of a node among the children of one."""
    return [child for node in nodes for child in node.get("children", [])]


def _local_matrices(
    nodes: list[dict[str, Any]], numbers: Iterable[int]
) -> Float[np.ndarray, "N 4 4"]:
    columns = {
        name: np.array([_numbers(nodes, number, name, usual) for number in numbers])
        for name, usual in UNMOVED.items()
    }
    matrices = _placements(*(columns[name] for name in ("translation", "rotation", "scale")))
    given = [("matrix" in nodes[number]) for number in numbers]
    matrices[given] = columns["matrix"][given].reshape(-1, 4, 4).transpose(0, 2, 1)
    return matrices


def _numbers(
    nodes: list[dict[str, Any]], number: int, name: str, usual: Float[np.ndarray, " K"]
) -> Float[np.ndarray, " K"]:
    if name not in nodes[number]:
        return usual
    with suppress(TypeError, ValueError, OverflowError):
        values = np.array(nodes[number][name], dtype=np.float64)
        if values.shape == usual.shape and np.isfinite(values).all():
            return values
    raise GltfError(f"{name} must be {len(usual)} numbers", pointer=f"/nodes/{number}/{name}")


def _shown_weights(document: Document, node: int, mesh: int) -> list[float]:
    """Return the weights of morph targets that viewers show a mesh with; none is 0 each."""
    own = document.nodes[node].weights
    return document.meshes[mesh].weights if own is None else own


def _place(
    tree: dict[str, Any],
    mesh: int,
    surfaces: Sequence[Surface],
    matrix: Float[np.ndarray, "4 4"],
    weights: list[float],
    joints: Float[np.ndarray, "J 4 4"] | None,
) -> MeshFile:
    """Return a mesh in the world, closed at its seams, by its morphs and its joints."""
    primitives = [surface.primitive for surface in surfaces]
    positions = np.concatenate([p.attributes["POSITION"] for p in primitives]).astype(np.float64)
    follows = read_skin_and_morph(primitives)
    for weight, delta in zip(weights, follows.deltas, strict=False):
        positions += weight * delta.astype(np.float64)
    known = [surface.vertex for surface in surfaces if surface.vertex is not None]
    ends = np.cumsum([len(p.attributes["POSITION"]) for p in primitives])
    corners = [p.corners for p in primitives]
    if len(known) == len(surfaces):
        vertex_of = np.concatenate(known)
        used = np.flatnonzero(marked(vertex_of, int(vertex_of.max()) + 1))
        vertex_of = vertex_of if used[-1] + 1 == len(used) else np.searchsorted(used, vertex_of)
    else:
        faces = disjoint_faces(zip(corners, np.diff(ends, prepend=0), strict=True))
        vertex_of = weld(positions, faces, follows.labels).vertex_of
    used = np.flatnonzero(vertex_of >= 0)
    rows = np.empty(int(vertex_of.max()) + 1, dtype=np.int64)
    rows[vertex_of[used]] = used
    points = positions[rows]
    world = _times(points, matrix[:3, :3]) + matrix[:3, 3]
    if joints is not None and follows.binding is not None:
        world = posed(points, follows.binding.take(rows), joints, placed=world)
        matrix = joints[0]
    # A mirroring node turns faces over; their order of corners keeps them facing outwards.
    mirrored = np.linalg.det(matrix[:3, :3]) < 0
    turn = slice(None, None, -1 if mirrored else 1)
    given = tree["meshes"][mesh]["primitives"]
    materials = [given[p.number].get("material", NONE) for p in primitives]
    columns: dict[str, list[Shaped[np.ndarray, "N K"] | None]] = {
        UV: [
            _uv(primitive, tree["materials"][material] if material >= 0 else {})
            for primitive, material in zip(primitives, materials, strict=True)
        ],
        # What a skin turns is written without: normals follow its joints one by one.
        NORMAL: [
            _turned(p.attributes["NORMAL"], matrix)
            if "NORMAL" in p.attributes and joints is None
            else None
            for p in primitives
        ],
        COLOUR: [p.attributes.get("COLOR_0") for p in primitives],
    }
    for name in dict.fromkeys(n for p in primitives for n in p.attributes if n.startswith("_")):
        columns[name] = [p.attributes.get(name) for p in primitives]
    corners = [own[:, turn].reshape(-1) for own in corners]
    layers = {
        name: joined_layer(list(zip(values, corners, strict=True)))
        for name, values in columns.items()
        if any(column is not None for column in values)
    }
    of_face = np.repeat(materials, [len(p.corners) for p in primitives])
    vertices = np.split(vertex_of, ends[:-1])
    vertices = [own[places] for own, places in zip(vertices, corners, strict=True)]
    placed = of_triangles(world, np.concatenate(vertices).reshape(-1, 3))
    return replace(placed, layers=layers, labels={MATERIAL: Labels((), of_face)})


def _times(
    rows: Float[np.ndarray, "N 3"], matrix: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return the product of a matrix with each row, by no BLAS, whose bits differ by machine."""
    return np.einsum("ni,ji->nj", rows, matrix)


def _turned(
    normals: Float[np.ndarray, "N 3"], matrix: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, "N 3"]:
    """Return normals as a matrix turns them: by its cofactors, which keep them outward."""
    linear = matrix[:3, :3]
    cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    sign = np.sign(np.linalg.det(linear)) or 1.0
    return unit(_times(normals.astype(np.float64), sign * cofactors))


def _uv(primitive: TrianglePrimitive, material: dict[str, Any]) -> Float[np.ndarray, "N 2"] | None:
    """Return the coordinates that a material's colour is looked up by, as it transforms them."""
    info = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
    transform = info.get("extensions", {}).get(TRANSFORM, {})
    number = transform.get("texCoord", info.get("texCoord", 0))
    values = primitive.attributes.get(f"TEXCOORD_{number}", primitive.attributes.get("TEXCOORD_0"))
    if values is None:
        return None
    u, v = values.astype(np.float64).T
    (su, sv), (ou, ov) = transform.get("scale", (1, 1)), transform.get("offset", (0, 0))
    angle = transform.get("rotation", 0)
    c, s = np.cos(angle), np.sin(angle)
    u, v = c * su * u + s * sv * v + ou, c * sv * v - s * su * u + ov
    # glTF counts v downwards.
    return np.column_stack([u, 1 - v])


def _joined(
    tree: dict[str, Any], placed: Sequence[MeshFile], names: Sequence[str], form: Format
) -> MeshFile:
    """Return all copies, by the names of their nodes, as one mesh that a format has room for."""
    layers: dict[str, Layer] = {}
    for name in dict.fromkeys(name for mesh in placed for name in mesh.layers):
        if form.layers is None or name in form.layers:
            own = [(mesh.layers.get(name), mesh.corners) for mesh in placed]
            layers[name] = joined_layer(
                [(None, corners) if o is None else (o.values, o.rows) for o, corners in own]
            )
    counts = [len(mesh.sizes) for mesh in placed]
    labels = {OBJECT: Labels(tuple(names), np.repeat(np.arange(len(placed)), counts))}
    materials = [
        str(entry.get("name", f"material {number}"))
        for number, entry in enumerate(tree.get("materials", []))
    ]
    if materials:
        of_face = np.concatenate([mesh.labels[MATERIAL].of_face for mesh in placed])
        labels[MATERIAL] = Labels(tuple(materials), of_face)
        if form.unit and COLOUR not in layers:
            layers[COLOUR] = Layer(_shown_colours(tree), np.repeat(of_face, 3))
    made = placed[0]
    if len(placed) > 1:
        faces = disjoint_faces((mesh.faces, len(mesh.vertices)) for mesh in placed)
        made = of_triangles(np.concatenate([mesh.vertices for mesh in placed]), faces)
    labels = {kind: label for kind, label in labels.items() if kind in form.labels}
    made = replace(made, layers=layers, labels=labels)
    if form.unit:
        # Metres, and z upwards.
        points = made.vertices * [1, 1, -1]
        made = replace(made, vertices=points[:, [0, 2, 1]], unit="meter")
    return made


def _shown_colours(tree: dict[str, Any]) -> UInt8[np.ndarray, "M 4"]:
    """Return the base colours of materials as sRGB and opacity, a byte each."""
    surfaces = (material.get("pbrMetallicRoughness", {}) for material in tree["materials"])
    given = np.array([surface.get("baseColorFactor", [1.0] * 4) for surface in surfaces])
    linear, opacity = given[:, :3], given[:, 3:]
    bright = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    shown = np.hstack([np.where(linear > 0.0031308, bright, 12.92 * linear), opacity])
    return np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)


def _changes(tree: dict[str, Any], placed: int, names: list[set[str]], kind: str) -> list[Change]:
    """Return what no format of plain meshes is given; what one of them cannot hold, it reports."""

    def lost_at(pointer: str, counts: dict[str, int]) -> list[Change]:
        return counted(
            {("not-written", what, kind.upper()): counts[what] for what in counts}, pointer
        )

    changes = [
        change for name in LOST for change in lost_at(f"/{name}", {name: len(tree.get(name) or ())})
    ]
    named = "definitions of materials" if MATERIAL in FORMATS[kind].labels else "materials"
    changes += lost_at("/materials", {named: len(tree.get("materials", []))})
    of_mesh = [mesh.get("primitives", []) for mesh in tree.get("meshes", [])]
    primitives = [primitive for own in of_mesh for primitive in own]
    modes = [primitive.get("mode", TRIANGLES) for primitive in primitives]
    targets = ([len(primitive.get("targets", [])) for primitive in own] for own in of_mesh)
    of_meshes = {
        "morph targets": sum(max(own, default=0) for own in targets),
        "points and lines": sum(mode not in SURFACES for mode in modes),
        "outlines": sum(OUTLINE in p.get("extensions", {}) for p in primitives),
    }
    changes += lost_at("/meshes", of_meshes)
    children = _children(tree.get("nodes", []))
    again = len(children) - len(set(children))
    told = {"several-parents": again, "nodes-joined": placed if placed > 1 else 0}
    changes += counted(told, "/nodes")
    form = FORMATS[kind]
    kept = {"POSITION", *((UV, NORMAL, COLOUR) if form.layers is None else form.layers)}
    lost = {
        name
        for own in names
        for name in own - kept
        if not (form.layers is None and name.startswith("_"))
    }
    counts = {f"attribute {name}": sum(name in own for own in names) for name in sorted(lost)}
    return changes + lost_at("/meshes", counts)
