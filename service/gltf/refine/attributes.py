"""Attributes and morph targets of refined primitives.

A morph target's deltas are added to refined attributes in proportion to a weight. At weight 1 its
normals are those of the surface that it makes, and its tangents are perpendicular to them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.carried import in_type_of
from pns_common.carry.grid import rounded_rows
from pns_common.mesh.normals import opposed_corners, perpendicular_tangents
from pns_common.mesh.rows import cross, dot, marked, unit
from pns_common.parallel import Blocks, available_threads

from ...meshes.barycentric_grid import BarycentricGrid
from ...meshes.split_connectivity import blocks_of, split_connectivity
from ...meshes.uv_charts import UvBlend
from ...stages import Stages
from ..read.primitives import TrianglePrimitive, distinct_corners
from ..read.schema import Accessor
from .control_mesh import ControlMesh, refined_ids, slices
from .mesh_refine import RefinedMesh
from .normals import Shading, safe_unit, shade
from .selection import Cut, cut_triangles, keep_still, with_still
from .skin import SkinAndMorph, skin_attributes

# Share of the progress that normals take.
SHADING = 0.85
# Numbers of features, in EXT_mesh_features and batched 3D tiles. They are floats where 16 bits do
# not suffice, since attributes cannot have wider integers.
_IDENTIFIER = re.compile(r"_?FEATURE_ID_[0-9]+|_BATCHID")

Columns = dict[str, Shaped[np.ndarray, "N K"]]


@dataclass(frozen=True, eq=False)
class RefinedPrimitive:
    """A refined primitive, in the types in which it is written.

    `vertex` is the vertex of the refined mesh at each row; None where it was cut from a union.
    `counts` is how many of the faces each face before became; None: as many of each. `outline` are
    the pairs of rows between which lines are drawn; None: the primitive draws none.
    """

    source: TrianglePrimitive
    faces: Int[np.ndarray, "F 3"]
    attributes: Columns
    targets: list[Columns]
    vertex: Int[np.ndarray, " N"] | None = None
    counts: Int[np.ndarray, " P"] | None = None
    outline: Int[np.ndarray, "N 2"] | None = None


@dataclass(frozen=True, eq=False)
class Vertices:
    """The N refined vertices of a primitive.

    Attributes:
        row: (C,) a row of the primitive's attributes for each distinct corner.
        vertex: (C,) the vertex of the control mesh at each corner.
        connectivity: how corners spread over refined vertices.
        positions, normals: refined, in the types written; normals None if there are none.
        exact_normals: in float64, for tangents; None if the primitive lacks either.
        skin_and_morph: skin binding and morph deltas.
        morphed_normals: normals under each morph target; None where it moves none.
    """

    row: Int[np.ndarray, " C"]
    vertex: Int[np.ndarray, " C"]
    connectivity: Blending
    positions: Float[np.ndarray, "N 3"]
    normals: Float[np.ndarray, "N 3"] | None
    exact_normals: Float[np.ndarray, "N 3"] | None
    skin_and_morph: SkinAndMorph
    morphed_normals: tuple[Float[np.ndarray, "N 3"] | None, ...]


def refined_primitives(
    control: ControlMesh,
    refined: RefinedMesh,
    grid: BarycentricGrid,
    uv_blend: UvBlend,
    stages: Stages,
    cut: Cut | None = None,
    ids: Int[np.ndarray, "P T"] | None = None,
) -> list[RefinedPrimitive]:
    """Return the refined primitives; primitives without faces are left out.

    `ids` are the refined vertices at the grid points of the kept faces, if they are known.
    """
    if ids is None:
        ids = refined_ids(control.weld, control.cleaned, refined.mesh, grid)
    ends = slices(control.kept_counts)
    if cut is not None:
        refined = with_still(refined, control, cut, ids, grid)
    with stages.part(0.0, SHADING):
        shading = shade(
            control,
            [ids[rows] for rows in ends],
            grid,
            refined.mesh.vertices,
            refined.skin_and_morph,
            refined.limit_normals,
            stages,
        )
    made: list[RefinedPrimitive] = []
    with stages.part(SHADING, 1.0):
        for number, rows in enumerate(ends):
            stages.reach(rows.start / len(ids))
            if rows.stop > rows.start:
                own = ids[rows]
                part = None if cut is None else Cut(cut.kind[rows], cut.still)
                each = _refined_primitive(
                    control, number, own, grid, refined, shading, uv_blend, part
                )
                before = None
                if control.authored or control.own is not None:
                    before = control.primitives[number].corners[control.kept[number]]
                made.append(facing(each, before))
    return made


def facing(refined: RefinedPrimitive, before: Int[np.ndarray, "P 3"] | None) -> RefinedPrimitive:
    """Return a refined primitive of which no normal points away from its face's front.

    At a child face that turned over, the normal and its tangent are mirrored, in a row of their
    own. `before` are the faces whose normals are the author's: where one of these pointed away, it
    is meant to, and so are those of its children.
    """
    attributes, blocks = refined.attributes, Blocks(available_threads())
    if "NORMAL" not in attributes:
        return refined
    points, normals = attributes["POSITION"], attributes["NORMAL"]
    opposed = opposed_corners(points, normals, refined.faces, blocks)
    if before is not None and opposed.any():
        old = refined.source.attributes
        meant = opposed_corners(old["POSITION"], old["NORMAL"], before, blocks).any(axis=1)
        counts = len(opposed) // len(before) if refined.counts is None else refined.counts
        opposed &= ~np.repeat(meant, counts)[:, None]
    if not opposed.any():
        return refined
    face, corner = np.nonzero(opposed)
    rows = refined.faces[face, corner]
    a, b, c = np.moveaxis(points[refined.faces[face]].astype(np.float64), 1, 0)
    front = unit(cross(b - a, c - a))
    more = {name: values[rows] for name, values in attributes.items()}
    for name in {"NORMAL", "TANGENT"} & more.keys():
        along = more[name][:, :3].astype(np.float64)
        more[name][:, :3] = along - 2 * dot(along, front)[:, None] * front
        # A mirror turns a frame's hand.
        more[name][:, 3:] *= -1
    targets = []
    for target in refined.targets:
        own = {name: values[rows] for name, values in target.items()}
        # A target's own directions stay as they are.
        for name in {"NORMAL", "TANGENT"} & own.keys() & more.keys():
            own[name] += attributes[name][rows, :3] - more[name][:, :3]
        targets.append(own)
    faces = refined.faces.copy()
    faces[face, corner] = len(points) + np.arange(len(rows))
    # A row may have been those corners' alone.
    used = np.flatnonzero(marked(faces.reshape(-1), len(points) + len(rows)))
    pairs = zip((attributes, *refined.targets), (more, *targets), strict=True)
    attributes, *targets = (
        {name: np.concatenate([values, new[name]])[used] for name, values in old.items()}
        for old, new in pairs
    )
    vertex = refined.vertex
    return replace(
        refined,
        faces=np.searchsorted(used, faces),
        attributes=attributes,
        targets=targets,
        vertex=None if vertex is None else np.append(vertex, vertex[rows])[used],
    )


def _refined_primitive(
    control: ControlMesh,
    number: int,
    ids: Int[np.ndarray, "F T"],
    grid: BarycentricGrid,
    refined: RefinedMesh,
    shading: Shading | None,
    uv_blend: UvBlend,
    cut: Cut | None,
) -> RefinedPrimitive:
    primitive = control.primitives[number]
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, primitive.corners[control.kept[number]], welded)
    if shading is not None and np.array_equal(corners, shading.groups.connectivity.faces):
        # Without seams inside of groups this split has been made.
        own = shading.groups.connectivity
    else:
        own = split_connectivity(corners, len(row), grid)
    vertex = own.at_vertices(ids)
    normals, exact, morphed = None, None, (None,) * len(refined.skin_and_morph.deltas)
    if shading is not None and number in shading.groups.ids:
        group = own.at_vertices(shading.groups.ids[number])
        normals, morphed = shading.rounded(group), shading.under_targets(group)
        exact = shading.exact(group) if "TANGENT" in primitive.attributes else None
    # Positions of text files are doubles and stay so.
    positions = (
        np.take(refined.mesh.vertices, vertex, axis=0)
        if primitive.is_double
        else rounded_rows(refined.mesh.vertices, vertex, blocks_of(grid))
    )
    vertices = Vertices(
        row=row,
        vertex=control.cleaned.vertex_map[welded[row]],
        connectivity=own,
        positions=positions,
        normals=normals,
        exact_normals=exact,
        skin_and_morph=refined.skin_and_morph.take(vertex),
        morphed_normals=morphed,
    )
    attributes = refined_attributes(primitive, vertices, uv_blend)
    targets = [
        refined_target(primitive, vertices, attributes, target)
        for target in range(len(primitive.targets))
    ]
    for name, values in refined.scalars.items():
        attributes[name] = values[vertex, None].astype(np.float32)
    if cut is None:
        return RefinedPrimitive(primitive, own.refined_faces, attributes, targets, vertex)
    still = cut.still[vertices.vertex]
    before = primitive.attributes, *primitive.targets
    for columns, old in zip((attributes, *targets), before, strict=True):
        keep_still(columns, old, row, still)
    faces, counts = cut_triangles(cut.kind, own.ids, grid)
    used = np.flatnonzero(marked(faces.reshape(-1), own.count))
    attributes, *targets = (
        {name: values[used] for name, values in columns.items()}
        for columns in (attributes, *targets)
    )
    faces = np.searchsorted(used, faces)
    return RefinedPrimitive(primitive, faces, attributes, targets, vertex[used], counts)


def refined_attributes(
    primitive: TrianglePrimitive, vertices: Vertices, uv_blend: UvBlend
) -> Columns:
    """Return the refined attributes in the file's order, in their component types."""
    skin: Columns = {}
    if vertices.skin_and_morph.binding is not None:
        skin = skin_attributes(primitive, vertices.skin_and_morph.binding)
    own, refined = vertices.connectivity, Columns()
    for name, values in primitive.attributes.items():
        corners = values[vertices.row]
        if name == "POSITION":
            refined[name] = vertices.positions
        elif name == "NORMAL" and vertices.normals is not None:
            refined[name] = vertices.normals
        elif name == "TANGENT":
            direction = _tangents(own.linear(corners[:, :3]), vertices.exact_normals)
            sign = own.nearest(corners[:, 3:])
            refined[name] = np.hstack([direction, sign]).astype(np.float32)
        elif name in skin:
            refined[name] = skin[name]
        elif name.startswith("TEXCOORD_"):
            refined[name] = in_type_of(values, uv_blend(own, vertices.vertex, corners))
        else:
            refined[name] = blend(name, own, corners, primitive.accessors[name])
    return refined


def refined_target(
    primitive: TrianglePrimitive, vertices: Vertices, base: Columns, number: int
) -> Columns:
    """Return the refined deltas of a morph target; `base` are the refined attributes."""
    own, refined, normals = vertices.connectivity, Columns(), vertices.morphed_normals[number]
    for name, values in primitive.targets[number].items():
        corners = values[vertices.row]
        if name == "POSITION":
            refined[name] = vertices.skin_and_morph.deltas[number]
        elif name == "NORMAL" and normals is not None:
            refined[name] = (normals - base[name]).astype(np.float32, copy=False)
        elif name == "TANGENT" and name in base:
            directions = own.linear(primitive.attributes[name][vertices.row, :3] + corners)
            under = normals if "NORMAL" in primitive.targets[number] else None
            morphed = _tangents(directions, vertices.exact_normals if under is None else under)
            refined[name] = (morphed - base[name][:, :3]).astype(np.float32)
        else:
            refined[name] = blend(name, own, corners, primitive.target_accessors[number][name])
    return refined


class Blending(Protocol):
    """A split that carries values of its rows to the refined ones."""

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Return blends."""
        ...

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values of nearest rows."""
        ...


def blend(
    name: str, own: Blending, corners: Shaped[np.ndarray, "C K"], accessor: Accessor
) -> Shaped[np.ndarray, "N K"]:
    """Return linear blends; of identifiers and other whole numbers, values of nearest corners."""
    fraction = accessor.normalized or name.startswith("COLOR_")
    whole = corners.dtype.kind != "f" and not fraction
    if whole or _IDENTIFIER.fullmatch(name):
        return own.nearest(corners)
    return in_type_of(corners, own.linear(corners))


def _tangents(
    directions: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"] | None
) -> Float[np.ndarray, "N 3"]:
    """Return unit tangents, perpendicular to the normals if there are any."""
    if normals is None:
        return safe_unit(directions)
    return perpendicular_tangents(directions, normals, Blocks(available_threads()))
