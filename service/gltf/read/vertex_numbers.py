"""Extensions of meshes that list their vertices by number, and that a mesh can do without.

Refined vertices have other numbers, and a reader that believes the old ones makes another mesh of
them. EXT_mesh_manifold says which vertices are one: positions still do, they are equal in bits.
EXT_mesh_primitive_restart, BENTLEY_primitive_restart before, draws several strips as one, and they
are written as triangles. So the mesh is refined without them, and that is told.
"""

from __future__ import annotations

from typing import Any

from ...report import Change
from .extensions import drop, withdraw
from .modes import SURFACES, TRIANGLES

BY_NUMBER = ("EXT_mesh_manifold", "EXT_mesh_primitive_restart", "BENTLEY_primitive_restart")


def leave_out_vertex_numbers(tree: dict[str, Any]) -> list[Change]:
    """Take such extensions out of the meshes that will be refined; where they were."""
    return [change for name in BY_NUMBER for change in _leave_out(tree, name)]


def _leave_out(tree: dict[str, Any], name: str) -> list[Change]:
    changes: list[Change] = []
    stays = False
    for number, mesh in enumerate(tree.get("meshes", [])):
        extensions = mesh.get("extensions")
        if not isinstance(extensions, dict) or name not in extensions:
            continue
        if not any(p.get("mode", TRIANGLES) in SURFACES for p in mesh.get("primitives", [])):
            stays = True
            continue
        drop(mesh, name)
        what = f"left out: {name}, by the numbers of vertices"
        changes.append(Change(f"/meshes/{number}", what, 1))
    if changes and not stays:
        withdraw(tree, name)
    return changes
