"""Refine the faces of one material or group alone, as `pns_common.mesh.selection` describes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Int, Shaped

from pns_common.mesh.mesh import Mesh
from pns_common.mesh.selection import transitions

from ...errors import UnrefinableError
from ...meshes.barycentric_grid import BarycentricGrid
from ...options import Options
from ..read.upload import Upload
from .control_mesh import ControlMesh
from .mesh_refine import RefinedMesh

ALL = 8
Chosen = Sequence[Bool[np.ndarray, " F"]]


@dataclass(frozen=True, eq=False)
class Cut:
    """A cut of the kept faces of a mesh.

    Attributes:
        kind: (P,) which sides are split, as in `transitions`; ALL: the face is refined.
        still: (V,) vertices of the mesh to refine that no chosen face has.
    """

    kind: Int[np.ndarray, " P"]
    still: Bool[np.ndarray, " V"]


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


def cut_faces(control: ControlMesh, chosen: Chosen) -> Cut:
    """Return how the kept faces are cut; `chosen` says which faces of each primitive are."""
    proper = np.concatenate(control.kept)
    own = control.cleaned.vertex_map[control.weld.faces[proper]]
    picked = np.concatenate(chosen)[proper]
    sides = np.sort(np.stack([own, np.roll(own, -1, axis=1)], axis=2), axis=2)
    keys = sides @ [len(control.mesh.vertices), 1]
    kind = np.isin(keys, keys[picked]) @ [1, 2, 4]
    still = np.ones(len(control.mesh.vertices), dtype=bool)
    still[own[picked]] = False
    return Cut(np.where(picked, ALL, kind), still)


def with_still(
    refined: RefinedMesh,
    control: ControlMesh,
    cut: Cut,
    ids: Int[np.ndarray, "P T"],
    grid: BarycentricGrid,
) -> RefinedMesh:
    """Return the refined mesh with flat faces where they are not chosen, for their normals."""
    points = np.array(refined.mesh.vertices)
    points[: len(cut.still)][cut.still] = control.mesh.vertices[cut.still]
    rest = np.flatnonzero(cut.kind != ALL)
    split = cut.kind[rest, None] >> np.arange(3) & 1 > 0
    fixed = np.hstack([np.ones((len(rest), 3), bool), split, np.zeros((len(rest), 1), bool)])
    flat = grid.points / grid.segments @ points[ids[rest, :3]]
    loose = ~fixed[:, grid.owner]
    points[ids[rest][loose]] = flat[loose]
    normals = refined.limit_normals
    if normals is not None:
        normals = np.array(normals)
        normals[: len(cut.still)][cut.still] = 0
    mesh = Mesh.of_refined(points, refined.mesh.faces)
    return replace(refined, mesh=mesh, limit_normals=normals)


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


def cut_triangles(
    kind: Int[np.ndarray, " F"], ids: Int[np.ndarray, "F T"], grid: BarycentricGrid
) -> tuple[Int[np.ndarray, "G 3"], Int[np.ndarray, " F"]]:
    """Return the triangles of faces by their refined vertices, and how many each face has."""
    local = np.concatenate([np.arange(3), grid.sides.reshape(-1)])
    patterns = [*(local[own] for own in transitions(grid.segments)), grid.faces]
    owners, blocks = list[np.ndarray](), list[np.ndarray]()
    for number, triangles in enumerate(patterns):
        own = np.flatnonzero(kind == number)
        blocks.append(ids[own][:, triangles].reshape(-1, 3))
        owners.append(np.repeat(own, len(triangles)))
    order = np.argsort(np.concatenate(owners), kind="stable")
    counts = np.array([len(triangles) for triangles in patterns])[kind]
    return np.concatenate(blocks)[order], counts
