"""Hand each primitive its share of a refined mesh: its faces and all its attributes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.mesh import Cleaned
from pns_common.refine import Refinement
from service.gltf.attributes import RefinedVertices, refined_attributes
from service.gltf.charts import UvBlend
from service.gltf.control_mesh import ControlMesh, slices
from service.gltf.followers import Followers
from service.gltf.lattice import Lattice
from service.gltf.primitives import TrianglePrimitive, distinct_corners
from service.gltf.shading import Shading, shade
from service.gltf.spread import spread
from service.gltf.targets import Deltas, refined_targets
from service.weld import Weld


@dataclass(frozen=True, eq=False)
class RefinedPrimitive:
    """A primitive after refinement, in the types that it is written in."""

    source: TrianglePrimitive
    faces: Int[np.ndarray, "F 3"]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    targets: list[Deltas]


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """What the operator made of a control mesh; all of it is given at the refined vertices.

    `scalars` are further attributes by name.
    """

    refinement: Refinement
    followers: Followers
    scalars: dict[str, Float[np.ndarray, " V"]]


def share(
    control: ControlMesh,
    cleaned: Cleaned,
    refined: RefinedMesh,
    grid: Lattice,
    uv_blend: UvBlend,
) -> list[RefinedPrimitive]:
    """The refined primitives; one that has no face left is not among them."""
    ids = refined_ids(control.weld, cleaned, refined.refinement, grid)
    ends = slices([int(keep.sum()) for keep in control.kept])
    points = refined.refinement.mesh.vertices
    shading = shade(control, [ids[at] for at in ends], grid, points, refined.followers)
    return [
        _refined_primitive(control, number, ids[at], grid, refined, shading, uv_blend)
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
    refined: RefinedMesh,
    shading: Shading | None,
    uv_blend: UvBlend,
) -> RefinedPrimitive:
    primitive = control.primitives[number]
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, primitive.corners[control.kept[number]], welded)
    own = spread(corners, len(row), grid)
    vertex = own.at_vertices(ids)
    normals, morphed = None, (None,) * len(refined.followers.deltas)
    if shading is not None and number in shading.groups.ids:
        normals, morphed = shading.take(own.at_vertices(shading.groups.ids[number]))
    at = RefinedVertices(
        row=row,
        welded=welded[row],
        spread=own,
        positions=refined.refinement.mesh.vertices[vertex],
        normals=normals,
        followers=refined.followers.take(vertex),
        morphed_normals=morphed,
    )
    attributes = refined_attributes(primitive, at, uv_blend)
    targets = refined_targets(primitive, at, attributes)
    for name, values in refined.scalars.items():
        attributes[name] = values[vertex, None].astype(np.float32)
    return RefinedPrimitive(primitive, own.refined_faces, attributes, targets)
