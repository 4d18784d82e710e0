"""The node tree: strict, as glTF 2.0 §3.5.2 asks, so that no file instances a mesh without end."""

from __future__ import annotations

from service.errors import GltfError
from service.gltf.references import refer
from service.gltf.schema import Document


def check_nodes(document: Document) -> None:
    """Check the nodes' references, that each node has one parent at most, and that none is its own.

    Raises:
        GltfError: with the JSON pointer of the reference that does not hold.
    """
    parent: dict[int, int] = {}
    for number, node in enumerate(document.nodes):
        pointer = f"/nodes/{number}"
        refer(node.mesh, document.meshes, f"{pointer}/mesh")
        refer(node.skin, document.skins, f"{pointer}/skin")
        refer(node.camera, document.cameras, f"{pointer}/camera")
        for place, child in enumerate(node.children):
            refer(child, document.nodes, f"{pointer}/children/{place}")
            if child in parent:
                raise GltfError(
                    f"node {child} has two parents, {parent[child]} and {number}",
                    pointer=f"{pointer}/children/{place}",
                )
            parent[child] = number
    _check_acyclic(len(document.nodes), parent)
    refer(document.scene, document.scenes, "/scene")
    for number, scene in enumerate(document.scenes):
        for place, root in enumerate(scene.nodes):
            # Some exporters list a child as a root too. It draws the child twice and no more.
            refer(root, document.nodes, f"/scenes/{number}/nodes/{place}")


def mesh_instances(document: Document) -> list[int]:
    """For each mesh the number of nodes that show it."""
    counts = [0] * len(document.meshes)
    for node in document.nodes:
        if node.mesh is not None:
            counts[node.mesh] += 1
    return counts


def _check_acyclic(count: int, parent: dict[int, int]) -> None:
    """Walk up from every node once: a walk that meets itself has found a cycle."""
    walk_of = [-1] * count
    for start in range(count):
        node = start
        while walk_of[node] < 0:
            walk_of[node] = start
            if node not in parent:
                break
            node = parent[node]
        else:
            if walk_of[node] == start:
                raise GltfError(f"node {node} is its own ancestor", pointer=f"/nodes/{node}")
