"""Refine the faces of one material or group alone, as `pns_common.mesh.selection` describes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int, Shaped

from pns_common.mesh.mesh import Mesh
from pns_common.mesh.selection import select
from pns_common.mesh.topology import build_topology

from ...errors import UnrefinableError
from ...options import Options
from ..read.upload import Upload
from .control_mesh import ControlMesh
from .mesh_refine import RefinedMesh
from .split import WholeLevels

Chosen = Sequence[Bool[np.ndarray, " F"]]


def chosen_primitives(upload: Upload, options: Options) -> dict[tuple[int, int], bool] | None:
    """Return of each primitive whether the options choose it; None where all are.

    A group of a glTF is a mesh, by its own name or that of a node that shows it.

    Raises:
        UnrefinableError: none is chosen.
    """
    if not options.selects:
        return None
    tree, made = upload.tree, dict[tuple[int, int], bool]()
    materials = [str(entry.get("name", "")) for entry in tree.get("materials", [])]
    names = [{str(mesh.get("name", ""))} for mesh in tree["meshes"]]
    for node in tree.get("nodes", []):
        if "mesh" in node:
            names[node["mesh"]].add(str(node.get("name", "")))
    for plan in upload.plans:
        for number in plan.primitives:
            material = tree["meshes"][plan.mesh]["primitives"][number].get("material", -1)
            made[plan.mesh, number] = (
                options.material in (None, materials[material] if material >= 0 else "")
            ) and (options.group is None or options.group in names[plan.mesh])
    check_chosen(options, any(made.values()), materials, set().union(*names))
    return made


def check_chosen(options: Options, found: bool, materials: Sequence[str], groups: set[str]) -> None:
    """Raise UnrefinableError, with the names that there are, if no face is chosen."""
    if not found:
        asked = {"material": options.material, "group": options.group}
        what = " and ".join(f"{kind} {name!r}" for kind, name in asked.items() if name is not None)
        there = ", ".join(sorted({*materials, *groups} - {""})) or "no names"
        raise UnrefinableError(f"no face has {what}: the file has {there}")


def keep_chosen(made: RefinedMesh, control: ControlMesh, chosen: Chosen) -> RefinedMesh:
    """Return a refined mesh of triangles without what refines faces that are not chosen.

    `chosen` says which faces of each primitive are. Vertices of no chosen face are where they were.
    """
    if not isinstance(made.split, WholeLevels):
        raise TypeError("faces of several levels are all chosen")
    proper, levels = np.concatenate(control.kept), made.split.levels
    own = control.cleaned.vertex_map[control.weld.faces[proper]]
    before = build_topology(own, len(control.mesh.vertices))
    points = np.array(made.mesh.vertices)
    refined = made.split.vertices.reshape(-1, 3)
    cut = select(np.concatenate(chosen)[proper], before, refined, len(points), levels)
    points[: len(cut.still)][cut.still] = control.mesh.vertices[cut.still]
    normals = made.limit_normals
    if normals is not None:
        normals = np.array(normals)
        normals[: len(cut.still)][cut.still] = 0
    return replace(
        made,
        mesh=Mesh.of_refined(points, made.mesh.faces),
        limit_normals=normals,
        split=replace(made.split, places=cut.places),
        parents=None if made.parents is None else made.parents.unmoved(cut.still),
        still=cut.still,
    )


def keep_still(
    columns: dict[str, Shaped[np.ndarray, "N K"]],
    before: dict[str, Shaped[np.ndarray, "N K"]],
    rows: Int[np.ndarray, " C"],
    still: Bool[np.ndarray, " C"],
) -> None:
    """Give the first refined rows that are still the values they had, in place; else 0."""
    at = np.flatnonzero(still)
    for name, values in columns.items():
        values[at] = before[name][rows[at]] if name in before else 0
