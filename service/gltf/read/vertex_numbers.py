"""EXT_mesh_manifold: which vertices of a mesh are one, by their numbers.

Refined vertices have other numbers, and a reader that believes the old ones makes another mesh of
them. Refinement joins vertices by position, and positions still say which are one: they are equal
in bits. So the mesh is refined without the extension, and that is told.
"""

from __future__ import annotations

from typing import Any

from ...report import Change
from .extensions import withdraw
from .modes import SURFACES, TRIANGLES

MANIFOLD = "EXT_mesh_manifold"


def leave_out_vertex_numbers(tree: dict[str, Any]) -> list[Change]:
    """Take the extension out of the meshes that will be refined; where it was."""
    changes: list[Change] = []
    stays = False
    for number, mesh in enumerate(tree.get("meshes", [])):
        extensions = mesh.get("extensions")
        if not isinstance(extensions, dict) or MANIFOLD not in extensions:
            continue
        if not any(p.get("mode", TRIANGLES) in SURFACES for p in mesh.get("primitives", [])):
            stays = True
            continue
        del extensions[MANIFOLD]
        if not extensions:
            del mesh["extensions"]
        what = f"left out: {MANIFOLD}, by the numbers of vertices"
        changes.append(Change(f"/meshes/{number}", what, 1))
    if changes and not stays:
        withdraw(tree, MANIFOLD)
    return changes
