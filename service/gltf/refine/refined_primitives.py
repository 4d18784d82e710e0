"""Hand each primitive its share of a refined mesh: its faces and all its attributes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.connectivity.grid_points import index_type
from pns_common.fused.where_loaded.grid_points import rounded_rows, take_points
from pns_common.mesh import Cleaned
from pns_common.refine import Refinement

from ...course import Course
from ...meshes.barycentric_grid import BarycentricGrid
from ...meshes.split_connectivity import blocks_of, split_connectivity
from ...meshes.uv_charts import UvBlend
from ...meshes.weld import Weld
from ..read.primitives import TrianglePrimitive, distinct_corners
from .attributes import RefinedVertices, refined_attributes
from .control_mesh import ControlMesh, slices
from .shading import Shading, shade
from .skin_and_morph import SkinAndMorph
from .targets import Deltas, refined_targets

# The share of the work that normals are; what is left is for all other attributes.
SHADING = 0.85


@dataclass(frozen=True, eq=False)
class RefinedPrimitive:
    """A primitive after refinement, in the types that it is written in.

    `vertex` is the vertex of the refined mesh at each row, where it was not cut out of a union.
    """

    source: TrianglePrimitive
    faces: Int[np.ndarray, "F 3"]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    targets: list[Deltas]
    vertex: Int[np.ndarray, " N"] | None = None


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """What the operator made of a control mesh; all of it is given at the refined vertices.

    `scalars` are further attributes by name; `limit_normals` are wanted in place of the faces' own.
    """

    refinement: Refinement
    skin_and_morph: SkinAndMorph
    scalars: dict[str, Float[np.ndarray, " V"]]
    limit_normals: Float[np.ndarray, "V 3"] | None = None


def refined_primitives(
    control: ControlMesh,
    cleaned: Cleaned,
    refined: RefinedMesh,
    grid: BarycentricGrid,
    uv_blend: UvBlend,
    course: Course,
) -> list[RefinedPrimitive]:
    """Return the refined primitives; one that has no face left is not among them."""
    ids = refined_ids(control.weld, cleaned, refined.refinement, grid)
    ends = slices([int(keep.sum()) for keep in control.kept])
    points = refined.refinement.mesh.vertices
    with course.part(0.0, SHADING):
        shading = shade(
            control,
            [ids[rows] for rows in ends],
            grid,
            points,
            refined.skin_and_morph,
            refined.limit_normals,
            course,
        )
    made: list[RefinedPrimitive] = []
    with course.part(SHADING, 1.0):
        for number, rows in enumerate(ends):
            course.reach(rows.start / len(ids))
            if rows.stop > rows.start:
                own = ids[rows]
                made.append(
                    _refined_primitive(
                        control, cleaned, number, own, grid, refined, shading, uv_blend
                    )
                )
    return made


def refined_ids(
    welded: Weld, cleaned: Cleaned, refinement: Refinement, grid: BarycentricGrid
) -> Int[np.ndarray, "P T"]:
    """Return the refined vertex at each grid point of each face that is not degenerate.

    Copies of a face (double-sided modelling, decals) take the vertices of the one that was refined,
    in their own order of corners.
    """
    proper = cleaned.representative >= 0
    leader = cleaned.representative[proper]
    corners = refinement.mesh.faces.reshape(len(cleaned.mesh.faces), -1)
    narrow = index_type(len(refinement.mesh.vertices))
    ids = take_points(corners, grid.slot, narrow, blocks_of(grid))
    if not np.array_equal(leader, np.arange(len(leader))):
        ids = np.take(ids, leader, axis=0)
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
    cleaned: Cleaned,
    number: int,
    ids: Int[np.ndarray, "F T"],
    grid: BarycentricGrid,
    refined: RefinedMesh,
    shading: Shading | None,
    uv_blend: UvBlend,
) -> RefinedPrimitive:
    primitive, points = control.primitives[number], refined.refinement.mesh.vertices
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, primitive.corners[control.kept[number]], welded)
    if shading is not None and np.array_equal(corners, shading.groups.connectivity.faces):
        # No seam but where normals part: the same has been split before.
        own = shading.groups.connectivity
    else:
        own = split_connectivity(corners, len(row), grid)
    vertex = own.at_vertices(ids)
    normals, exact, morphed = None, None, (None,) * len(refined.skin_and_morph.deltas)
    if shading is not None and number in shading.groups.ids:
        group = own.at_vertices(shading.groups.ids[number])
        normals, morphed = shading.rounded(group), shading.under_targets(group)
        exact = shading.exact(group) if "TANGENT" in primitive.attributes else None
    refined_vertices = RefinedVertices(
        row=row,
        vertex=cleaned.vertex_map[welded[row]],
        connectivity=own,
        positions=_positions(points, vertex, grid, double=is_double(primitive)),
        normals=normals,
        exact_normals=exact,
        skin_and_morph=refined.skin_and_morph.take(vertex),
        morphed_normals=morphed,
    )
    attributes = refined_attributes(primitive, refined_vertices, uv_blend)
    targets = refined_targets(primitive, refined_vertices, attributes)
    for name, values in refined.scalars.items():
        attributes[name] = values[vertex, None].astype(np.float32)
    return RefinedPrimitive(primitive, own.refined_faces, attributes, targets, vertex)


def is_double(primitive: TrianglePrimitive) -> bool:
    """Return whether positions are doubles, as those of text files: no glTF has them."""
    return primitive.attributes["POSITION"].itemsize == 8


def _positions(
    points: Float[np.ndarray, "V 3"],
    vertex: Int[np.ndarray, " N"],
    grid: BarycentricGrid,
    *,
    double: bool,
) -> Float[np.ndarray, "N 3"]:
    return (
        np.take(points, vertex, axis=0) if double else rounded_rows(points, vertex, blocks_of(grid))
    )
