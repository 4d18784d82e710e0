"""Attributes and morph targets of refined primitives.

A morph target's deltas are added to refined attributes in proportion to a weight. At weight 1 its
normals are those of the surface that it makes, and its tangents are perpendicular to them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from pns_common.carry.carried import in_type_of
from pns_common.carry.rows import rounded_rows
from pns_common.mesh.creases import Creases
from pns_common.mesh.normals import opposed_corners, perpendicular_tangents
from pns_common.mesh.rows import cross, dot, marked, unit
from pns_common.parallel import Blocks, available_threads

from ...options import Options
from ...stages import Stages
from ..read.primitives import TrianglePrimitive, distinct_corners
from ..read.schema import Accessor
from .control_mesh import ControlMesh
from .mesh_refine import RefinedMesh
from .normals import Shading, safe_unit, shade
from .selection import keep_still
from .skin import SkinAndMorph, skin_attributes
from .split import Values, WholeLevels

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
    `counts` is how many of the faces each face before became; None: not known. `outline` are
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
        values: refines values of distinct corners.
        positions, normals: refined, in the types written; normals None if there are none.
        exact_normals: in float64, for tangents; None if the primitive lacks either.
        skin_and_morph: skin binding and morph deltas.
        morphed_normals: normals under each morph target; None where it moves none.
    """

    row: Int[np.ndarray, " C"]
    values: Values
    positions: Float[np.ndarray, "N 3"]
    normals: Float[np.ndarray, "N 3"] | None
    exact_normals: Float[np.ndarray, "N 3"] | None
    skin_and_morph: SkinAndMorph
    morphed_normals: tuple[Float[np.ndarray, "N 3"] | None, ...]


def refined_primitives(
    control: ControlMesh,
    refined: RefinedMesh,
    creases: Creases,
    options: Options,
    stages: Stages,
) -> list[RefinedPrimitive]:
    """Return the refined primitives; primitives without faces are left out.

    `creases` are those of the mesh that was refined, by name.
    """
    with stages.part(0.0, SHADING):
        shading = shade(
            control,
            refined.split,
            refined.mesh.vertices,
            refined.skin_and_morph,
            refined.limit_normals,
            stages,
        )
    made: list[RefinedPrimitive] = []
    with stages.part(SHADING, 1.0):
        for number, share in enumerate(control.shares):
            stages.reach(number / len(control.shares))
            if share.stop > share.start:
                asked = control, number, refined, shading, creases, options
                made.append(facing(_refined_primitive(*asked), _opposed_before(control, number)))
    return made


def _opposed_before(
    control: ControlMesh, number: int
) -> Callable[[], Bool[np.ndarray, " Q"]] | None:
    """Return what finds kept faces with a normal of the author's that points away; None: none is.

    Such a normal is meant to.
    """
    if not control.authored:
        return None

    def opposed() -> Bool[np.ndarray, " Q"]:
        primitive, kept, share = control.primitives[number], control.faces, control.shares[number]
        old, triangles = primitive.attributes, primitive.corners[control.kept[number]]
        blocks = Blocks(available_threads())
        wrong = opposed_corners(old["POSITION"], old["NORMAL"], triangles, blocks)
        begin, end = kept.offsets[[share.start, share.stop]]
        own = kept.corners[begin:end] // 3 - sum(control.kept_counts[:number])
        starts = kept.offsets[share.start : share.stop] - begin
        made: Bool[np.ndarray, " Q"] = np.logical_or.reduceat(wrong[own].any(axis=1), starts)
        return made

    return opposed


def facing(
    refined: RefinedPrimitive, before: Callable[[], Bool[np.ndarray, " Q"]] | None
) -> RefinedPrimitive:
    """Return a refined primitive of which no normal points away from its face's front.

    At a child face that turned over, the normal and its tangent are mirrored, in a row of their
    own; those of faces where `before` says that one pointed away stay.
    """
    attributes, blocks = refined.attributes, Blocks(available_threads())
    if "NORMAL" not in attributes:
        return refined
    points, normals = attributes["POSITION"], attributes["NORMAL"]
    opposed = opposed_corners(points, normals, refined.faces, blocks)
    if before is not None and refined.counts is not None and opposed.any():
        opposed &= ~np.repeat(before(), refined.counts)[:, None]
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
    pairs = zip((attributes, *refined.targets), (more, *targets), strict=True)
    attributes, *targets = (
        {name: np.concatenate([values, new[name]]) for name, values in old.items()}
        for old, new in pairs
    )
    vertex = None if refined.vertex is None else np.append(refined.vertex, refined.vertex[rows])
    mirrored = replace(refined, attributes=attributes, targets=targets, vertex=vertex)
    # A row may have been those corners' alone.
    used = marked(faces.reshape(-1), len(points) + len(rows))
    return with_rows(replace(mirrored, faces=faces), np.flatnonzero(used))


def _refined_primitive(
    control: ControlMesh,
    number: int,
    refined: RefinedMesh,
    shading: Shading | None,
    creases: Creases,
    options: Options,
) -> RefinedPrimitive:
    primitive, split = control.primitives[number], refined.split.part(control.shares[number])
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, control.rows_at_corners(number), welded)
    rows = None if shading is None else shading.groups.rows
    alone = shading is not None and shading.groups.places.keys() == {number}
    # Without seams inside of groups this split has been made.
    if rows is None or not alone or not np.array_equal(corners, rows.corners):
        rows = split.rows(corners)
    vertex = split.vertices[rows.place]
    normals, exact, morphed = None, None, (None,) * len(refined.skin_and_morph.deltas)
    if shading is not None and number in shading.groups.places:
        group = shading.groups.rows.at[shading.groups.places[number]][rows.place]
        normals, morphed = shading.rounded(group), shading.under_targets(group)
        exact = shading.exact(group) if "TANGENT" in primitive.attributes else None
    # Positions of text files are doubles and stay so.
    positions = (
        np.take(refined.mesh.vertices, vertex, axis=0)
        if primitive.is_double
        else rounded_rows(refined.mesh.vertices, vertex, Blocks(available_threads()))
    )
    vertices = Vertices(
        row=row,
        values=rows.values,
        positions=positions,
        normals=normals,
        exact_normals=exact,
        skin_and_morph=refined.skin_and_morph.take(vertex),
        morphed_normals=morphed,
    )
    of_vertex = control.cleaned.vertex_map[welded[row]]

    blend_uv = rows.values.linear
    if options.uv == "smooth" and isinstance(split, WholeLevels):
        blend_uv = partial(split.smooth, rows, of_vertex, creases, limit=options.limit)
    attributes = refined_attributes(primitive, vertices, blend_uv)
    targets = [
        refined_target(primitive, vertices, attributes, target)
        for target in range(len(primitive.targets))
    ]
    for name, values in refined.scalars.items():
        attributes[name] = values[vertex, None].astype(np.float32)
    faces = split.faces(rows.at)
    made = RefinedPrimitive(primitive, faces, attributes, targets, vertex, split.counts)
    if refined.still is None:
        return made
    before, still = (primitive.attributes, *primitive.targets), refined.still[of_vertex]
    for columns, old in zip((attributes, *targets), before, strict=True):
        keep_still(columns, old, row, still)
    return with_rows(made, np.flatnonzero(marked(faces.reshape(-1), len(vertex))))


def with_rows(refined: RefinedPrimitive, used: Int[np.ndarray, " U"]) -> RefinedPrimitive:
    """Return a refined primitive with some of its rows, ascending, which its faces name."""
    attributes, *targets = (
        {name: values[used] for name, values in columns.items()}
        for columns in (refined.attributes, *refined.targets)
    )
    return replace(
        refined,
        faces=np.searchsorted(used, refined.faces),
        attributes=attributes,
        targets=targets,
        vertex=None if refined.vertex is None else refined.vertex[used],
    )


def refined_attributes(
    primitive: TrianglePrimitive,
    vertices: Vertices,
    blend_uv: Callable[[Shaped[np.ndarray, "C 2"]], Float[np.ndarray, "N 2"]],
) -> Columns:
    """Return the refined attributes in the file's order, in their component types."""
    skin: Columns = {}
    if vertices.skin_and_morph.binding is not None:
        skin = skin_attributes(primitive, vertices.skin_and_morph.binding)
    own, refined = vertices.values, Columns()
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
            refined[name] = in_type_of(values, blend_uv(corners))
        else:
            refined[name] = blend(name, own, corners, primitive.accessors[name])
    return refined


def refined_target(
    primitive: TrianglePrimitive, vertices: Vertices, base: Columns, number: int
) -> Columns:
    """Return the refined deltas of a morph target; `base` are the refined attributes."""
    own, refined, normals = vertices.values, Columns(), vertices.morphed_normals[number]
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


def blend(
    name: str, own: Values, corners: Shaped[np.ndarray, "C K"], accessor: Accessor
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
