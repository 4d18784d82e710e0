"""The node tree: references hold, and no node is inside itself, so that no viewer goes on for ever.

A node with several parents, or twice among the children of one, breaks glTF 2.0 §3.5.2 and changes
nothing for what is refined: it is reported as found.
"""

from __future__ import annotations

from collections import Counter

from ....errors import GltfError
from ....report import Change
from ..schema import Document
from .references import refer


def check_nodes(document: Document) -> list[Change]:
    """Check the nodes' references, and that none is its own ancestor; what else was found.

    Raises:
        GltfError: with the JSON pointer of the reference that does not hold.
    """
    parents: Counter[int] = Counter()
    several: list[str] = []
    for number, node in enumerate(document.nodes):
        pointer = f"/nodes/{number}"
        refer(node.mesh, document.meshes, f"{pointer}/mesh")
        refer(node.skin, document.skins, f"{pointer}/skin")
        refer(node.camera, document.cameras, f"{pointer}/camera")
        for place, child in enumerate(node.children):
            refer(child, document.nodes, f"{pointer}/children/{place}")
            parents[child] += 1
            if parents[child] > 1:
                several.append(f"{pointer}/children/{place}")
    _check_acyclic(document, parents)
    refer(document.scene, document.scenes, "/scene")
    for number, scene in enumerate(document.scenes):
        for place, root in enumerate(scene.nodes):
            # Some exporters list a child as a root too: it has a place, and that is its parent's.
            refer(root, document.nodes, f"/scenes/{number}/nodes/{place}")
    if not several:
        return []
    return [Change(several[0], "found, and left: nodes with more than one parent", len(several))]


def mesh_instances(document: Document) -> list[int]:
    """Return for each mesh the number of nodes that show it."""
    counts = [0] * len(document.meshes)
    for node in document.nodes:
        if node.mesh is not None:
            counts[node.mesh] += 1
    return counts


def _check_acyclic(document: Document, parents: Counter[int]) -> None:
    """Take away nodes without parents until none is left (Kahn 1962); the rest are cycles."""
    left = [parents[number] for number in range(len(document.nodes))]
    free = [number for number, count in enumerate(left) if count == 0]
    taken = 0
    while free:
        taken += 1
        for child in document.nodes[free.pop()].children:
            left[child] -= 1
            if left[child] == 0:
                free.append(child)
    if taken < len(left):
        node = _on_a_cycle(document, left)
        raise GltfError(f"node {node} is its own ancestor", pointer=f"/nodes/{node}")


def _on_a_cycle(document: Document, left: list[int]) -> int:
    """Return the first node that a walk comes back to; each node left has a parent left."""
    parent = {
        child: number
        for number, node in enumerate(document.nodes)
        if left[number]
        for child in node.children
    }
    node, seen = next(number for number, count in enumerate(left) if count), set[int]()
    while node not in seen:
        seen.add(node)
        node = parent[node]
    return node
