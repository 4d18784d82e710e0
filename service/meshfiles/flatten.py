"""A glTF scene as plain triangles, for formats that know no nodes; says what is lost on the way."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from pns_common.rows import disjoint_faces

from ..errors import UnrefinableError
from ..gltf.constants import SURFACES, TRIANGLES
from ..gltf.read.extensions import INSTANCING
from ..gltf.read.primitives import TrianglePrimitive, read_primitive
from ..gltf.read.schema import Document
from ..gltf.read.upload import read_upload
from ..gltf.refine.columns import read_skin_and_morph
from ..meshes.weld import weld
from ..options import Limits
from ..report import Change
from .formats import HOLDS_UV
from .indexed_triangles import IndexedTriangles
from .pose import joint_matrices, posed

TRANSFORM, VISIBILITY = "KHR_texture_transform", "KHR_node_visibility"
LOST = ("materials", "textures", "images", "animations", "skins", "cameras", "extensions")


def flatten(glb: bytes, kind: str, limits: Limits) -> tuple[IndexedTriangles, list[Change]]:
    """Return the default scene's triangles in the world, and what a file of `kind` is not given.

    Raises:
        ServiceError: the file cannot be read, or its scene shows no triangles.
    """
    upload = read_upload(glb, "glb", 0, limits)
    primitives = {
        mesh.mesh: [
            read_primitive(upload.document, upload.buffers, mesh.mesh, number)
            for number in mesh.primitives
        ]
        for mesh in upload.plans
    }
    worlds, hidden = _placed_nodes(upload.tree)
    placed = [
        (
            primitives[mesh],
            _shown_weights(upload.document, node, mesh),
            worlds[node],
            joint_matrices(upload, node, worlds),
        )
        for node in worlds
        if (mesh := upload.document.nodes[node].mesh) in primitives and node not in hidden
    ]
    if not placed:
        raise UnrefinableError("the default scene shows no triangles")
    names = [set(p.attributes) for shown, *_ in placed for p in shown]
    keeps_uv = kind in HOLDS_UV and all("TEXCOORD_0" in name for name in names)
    mesh_file = _joined([_placed(*where, keeps_uv=keeps_uv) for where in placed])
    changes = _changes(upload.tree, len(placed), names, kind, keeps_uv=keeps_uv)
    left = {n for n, node in enumerate(upload.document.nodes) if node.mesh in primitives}
    for what, count in (
        ("hidden nodes", len(left & hidden)),
        ("nodes outside of the default scene", len(left - worlds.keys())),
    ):
        if count:
            changes.append(Change("/nodes", f"{what} left out", count))
    return mesh_file, changes


def _placed_nodes(tree: dict[str, Any]) -> tuple[dict[int, Float[np.ndarray, "4 4"]], set[int]]:
    """Return the world matrices of the default scene's nodes, in the order of its tree.

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
    pending = [(root, np.eye(4), False) for root in reversed(ordered)]
    placed: dict[int, Float[np.ndarray, "4 4"]] = {}
    hidden: set[int] = set()
    while pending:
        number, above, under_hidden = pending.pop()
        # Once, whatever its parents: n nodes that are twice among the children of one are 2^n.
        if number in placed:
            continue
        node = nodes[number]
        placed[number] = world = above @ _local_matrix(node)
        if hides := under_hidden or _is_hidden(node):
            hidden.add(number)
        pending += [(child, world, hides) for child in reversed(node.get("children", []))]
    return placed, hidden


def _is_hidden(node: dict[str, Any]) -> bool:
    visibility = node.get("extensions", {}).get(VISIBILITY)
    return isinstance(visibility, dict) and visibility.get("visible") is False


def _children(nodes: list[dict[str, Any]]) -> list[int]:
    """Return every mention of a node among the children of one."""
    return [child for node in nodes for child in node.get("children", [])]


def _local_matrix(node: dict[str, Any]) -> Float[np.ndarray, "4 4"]:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _shown_weights(document: Document, node: int, mesh: int) -> list[float]:
    """Return the weights of morph targets that viewers show a mesh with; none is 0 each."""
    own = document.nodes[node].weights
    return document.meshes[mesh].weights if own is None else own


def _placed(
    primitives: list[TrianglePrimitive],
    weights: list[float],
    matrix: Float[np.ndarray, "4 4"],
    joints: Float[np.ndarray, "J 4 4"] | None,
    *,
    keeps_uv: bool,
) -> IndexedTriangles:
    """Place one mesh in the world; closed at its seams where nothing is left to tell them by."""
    positions = np.concatenate([p.attributes["POSITION"] for p in primitives]).astype(np.float64)
    follows = read_skin_and_morph(primitives)
    for weight, delta in zip(weights, follows.deltas, strict=False):
        positions += weight * delta.astype(np.float64)
    faces = disjoint_faces((p.corners, len(p.attributes["POSITION"])) for p in primitives)
    uv = np.concatenate([_uv(p) for p in primitives]) if keeps_uv else None
    rows = np.arange(len(positions))
    if uv is None:
        welded = weld(positions, faces)
        used = np.flatnonzero(welded.vertex_of >= 0)[::-1]
        rows = np.empty(len(welded.points), dtype=np.int64)
        rows[welded.vertex_of[used]] = used
        positions, faces = welded.points, welded.faces
    world = positions @ matrix[:3, :3].T + matrix[:3, 3]
    if joints is not None and follows.binding is not None:
        world = posed(positions, follows.binding.take(rows), joints, placed=world)
        matrix = joints[0]
    if np.linalg.det(matrix[:3, :3]) < 0:
        # A mirroring node turns faces over; their order of corners keeps them facing outwards.
        faces = faces[:, ::-1]
    return IndexedTriangles(world, faces, uv)


def _joined(parts: list[IndexedTriangles]) -> IndexedTriangles:
    uvs = [part.uv for part in parts if part.uv is not None]
    return IndexedTriangles(
        np.concatenate([part.vertices for part in parts]),
        disjoint_faces((part.faces, len(part.vertices)) for part in parts),
        np.concatenate(uvs) if uvs else None,
    )


def _uv(primitive: TrianglePrimitive) -> Float[np.ndarray, "N 2"]:
    values = primitive.attributes["TEXCOORD_0"]
    scale = 1 if values.dtype.kind == "f" else np.iinfo(values.dtype).max
    u, v = values.astype(np.float64).T / scale
    # glTF counts v downwards.
    return np.column_stack([u, 1 - v])


def _changes(
    tree: dict[str, Any], placed: int, names: list[set[str]], kind: str, *, keeps_uv: bool
) -> list[Change]:
    # Some of them know more: they are given positions, faces and, OBJ and PLY, one set of UVs.
    why = f": not written to {kind.upper()} files"
    changes = [
        Change(f"/{name}", f"{name} dropped{why}", len(tree[name]))
        for name in LOST
        if tree.get(name)
    ]
    changes += [
        Change(pointer, f"{what} dropped{why}", count)
        for pointer, what, count in (
            ("/meshes", "morph targets", _count_targets(tree)),
            ("/meshes", "points and lines", _count_other_modes(tree)),
            ("/nodes", f"copies by {INSTANCING}", _count_copies(tree)),
        )
        if count
    ]
    children = _children(tree.get("nodes", []))
    if again := len(children) - len(set(children)):
        changes.append(Change("/nodes", "nodes with several parents placed once, by one", again))
    if placed > 1:
        changes.append(Change("/nodes", "nodes joined into one mesh in world space", placed))
    lost = set[str]().union(*names) - {"POSITION"}
    if keeps_uv:
        lost.discard("TEXCOORD_0")
        if TRANSFORM in tree.get("extensionsUsed", []):
            what = f"texture coordinates written as they are stored: {TRANSFORM} is not applied"
            changes.append(Change("/materials", what, 1))
    changes += [
        Change(
            "/meshes",
            f"attribute {name} dropped{why}",
            sum(name in own for own in names),
        )
        for name in sorted(lost)
    ]
    return changes


def _count_targets(tree: dict[str, Any]) -> int:
    return sum(
        max(
            (len(primitive.get("targets", [])) for primitive in mesh.get("primitives", [])),
            default=0,
        )
        for mesh in tree.get("meshes", [])
    )


def _count_other_modes(tree: dict[str, Any]) -> int:
    """Return how many primitives are no surfaces."""
    return sum(
        primitive.get("mode", TRIANGLES) not in SURFACES
        for mesh in tree.get("meshes", [])
        for primitive in mesh.get("primitives", [])
    )


def _count_copies(tree: dict[str, Any]) -> int:
    """Return how many copies the nodes ask for; one of a node that does not say."""
    accessors, copies = tree.get("accessors", []), 0
    for node in tree.get("nodes", []):
        instances = node.get("extensions", {}).get(INSTANCING)
        if instances is None:
            continue
        attributes = instances.get("attributes") if isinstance(instances, dict) else None
        numbers = attributes.values() if isinstance(attributes, dict) else ()
        known = (n for n in numbers if isinstance(n, int) and 0 <= n < len(accessors))
        copies += next((accessors[number]["count"] for number in known), 1)
    return copies
