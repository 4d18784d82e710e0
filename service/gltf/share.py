"""Hand each primitive its share of a refined mesh: its faces and all its attributes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.mesh import Cleaned
from pns_common.refine import Refinement
from service.gltf.attributes import refined_attributes
from service.gltf.control_mesh import ControlMesh, slices
from service.gltf.lattice import Lattice, lattice
from service.gltf.primitives import TrianglePrimitive, distinct_corners
from service.gltf.smoothing import NormalGroups, recompute_normals
from service.gltf.spread import spread
from service.weld import Weld


@dataclass(frozen=True, eq=False)
class RefinedPrimitive:
    """A primitive after refinement; `attributes` are in the type that they are written in."""

    source: TrianglePrimitive
    faces: Int[np.ndarray, "F 3"]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]


def share(
    control: ControlMesh,
    cleaned: Cleaned,
    refinement: Refinement,
    levels: int,
    scalars: dict[str, Float[np.ndarray, " V"]],
) -> list[RefinedPrimitive]:
    """The refined primitives; one that has no face left is not among them.

    `scalars` are further attributes by name, given at the refined mesh's vertices.
    """
    grid = lattice(levels)
    ids = refined_ids(control.weld, cleaned, refinement, grid)
    points = refinement.mesh.vertices
    ends = slices([int(keep.sum()) for keep in control.kept])
    normals = recompute_normals(control, [ids[at] for at in ends], grid, points)
    return [
        _refined_primitive(control, number, ids[at], grid, points, normals, scalars)
        for number, at in enumerate(ends)
        if at.stop > at.start
    ]


def refined_ids(
    welded: Weld, cleaned: Cleaned, refinement: Refinement, grid: Lattice
) -> Int[np.ndarray, "P T"]:
    """The refined vertex at each lattice point of each face that is not degenerate.

    Copies of a face (double-sided modelling, decals) take the vertices of the one that was refined,
    in their own order of corners.
    """
    proper = cleaned.representative >= 0
    leader = cleaned.representative[proper]
    blocks = refinement.mesh.faces.reshape(len(cleaned.mesh.faces), -1)
    ids = np.take(np.take(blocks, grid.slot, axis=1), leader, axis=0)
    copies = np.flatnonzero(cleaned.face_map[proper] < 0)
    if len(copies):
        own = cleaned.vertex_map[welded.faces[proper][copies]]
        same = own[:, :, None] == cleaned.mesh.faces[leader[copies]][:, None, :]
        place = same.argmax(axis=2)
        reorder = grid.reorder[3 * place[:, 0] + place[:, 1]]
        ids[copies] = np.take_along_axis(ids[copies], reorder, axis=1)
    return ids


def _refined_primitive(
    control: ControlMesh,
    number: int,
    ids: Int[np.ndarray, "F T"],
    grid: Lattice,
    points: Float[np.ndarray, "V 3"],
    normals: NormalGroups,
    scalars: dict[str, Float[np.ndarray, " V"]],
) -> RefinedPrimitive:
    primitive = control.primitives[number]
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, primitive.corners[control.kept[number]], welded)
    own = spread(corners, len(row), grid)
    vertex = own.at_vertices(ids)
    normal = None
    if number in normals.ids:
        normal = normals.values[own.at_vertices(normals.ids[number])]
    attributes = refined_attributes(primitive, row, own, points[vertex], normal)
    for name, values in scalars.items():
        attributes[name] = values[vertex, None].astype(np.float32)
    return RefinedPrimitive(primitive, own.refined_faces, attributes)
