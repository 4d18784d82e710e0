"""Small meshes of one kind, refined as parts of one: what a step costs beside rows is paid once.

Scenes from CAD and building models hold thousands of meshes of a few faces. Each comes out as if it
had been alone, bit for bit: positions are joined within a part only, and nothing is ever summed
across parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.deferred import Deferred
from pns_common.connectivity.creases import Creases
from pns_common.errors import MeshError
from pns_common.fused.where_loaded.linear import linear_refinement
from pns_common.mesh import Cleaned
from pns_common.refine import Refinement, Report
from pns_common.refine_parts import PartsRefinement, refine_parts
from pns_common.schemes import Scheme

from ...course import Course
from ...meshes.barycentric_grid import barycentric_grid
from ...meshes.uv_charts import uv_blend
from ...options import Options
from ...report import Change
from ..read.primitives import TrianglePrimitive
from ..stage_shares import StageShares
from .common_slots import common_slots
from .control_mesh import ControlMesh, control_mesh, slices, vertex_rows
from .local_joints import local_joints
from .near_misses import change_of, near_misses
from .parts import Parts
from .refined_primitives import RefinedMesh, RefinedPrimitive, refined_primitives
from .refinement import (
    changes_of_primitive,
    changes_of_vertices,
    creases_of,
    leaves_single_precision,
)
from .skin_and_morph import SkinAndMorph, refine_skin_and_morph
from .smooth_normals import with_normal_accessor, with_smooth_normals
from .union import divided, joined
from .where_acted import vertex_scalars

# More faces than this, refined, and a mesh's own work is more than what surrounds it.
MOST_FACES = 2**15
# So much is refined at a time: the memory of a group is small beside that of a large mesh.
GROUP_FACES = 2**17


@dataclass(frozen=True, eq=False)
class Part:
    """What became of one mesh.

    Attributes:
        refined: its primitives that have a face left.
        kept: for each of its primitives, which faces do not name a welded vertex twice.
        copies: faces that follow another with the same vertices.
        report: the operator's.
        changes: what was joined, dropped or cut.
    """

    refined: list[RefinedPrimitive]
    kept: list[Bool[np.ndarray, " F"]]
    copies: int
    report: Report
    changes: list[Change]


@dataclass(frozen=True, eq=False)
class _Refined:
    """What the operator made of a union: for each part its report, and how many lost a joint."""

    mesh: RefinedMesh
    reports: list[Report]
    cut: Int[np.ndarray, " P"]


def refine_together(
    meshes: Sequence[Sequence[TrianglePrimitive]],
    pointers: Sequence[str],
    scheme: Scheme,
    options: Options,
    course: Course,
    shares: StageShares,
) -> list[Part | None]:
    """Refine meshes of one kind, given by their primitives; `pointers` say where they stand.

    None stands for one that must go alone: it has no face left or no extent, cannot be refined
    (alone, it is told why), or there are no kernels that could serve.
    """
    primitives, parts = joined(meshes)
    with course.stage("weld", shares.weld, shares.refine):
        control = control_mesh(primitives, options.weld_tolerance, options.weld_unit, parts)
    able = _able(control, parts)
    if control.cleaned is None or not able.all():
        return _chosen_together(able, meshes, pointers, scheme, options, course, shares)
    with course.stage("weld", shares.weld, shares.refine):
        creases = creases_of(control, options, scheme, parts)
        if options.normals != "keep":
            control, parts = _smoothed(control, control.cleaned, parts, creases, options)
    with course.stage("refine", shares.refine, shares.attributes):
        try:
            made = _refined(control, parts, creases, scheme, options, course)
        except MeshError:
            # Not to be told whose it is: the halves are asked, down to one.
            if len(meshes) == 1:
                return [None]
            half = np.arange(len(meshes)) < len(meshes) // 2
            rest = pointers, scheme, options, course, shares
            return [
                first or second
                for first, second in zip(
                    _chosen_together(half, meshes, *rest),
                    _chosen_together(~half, meshes, *rest),
                    strict=True,
                )
            ]
    if made is None or control.cleaned is None:
        return [None] * len(meshes)
    with course.stage("attributes", shares.attributes, shares.write):
        grid, blend = barycentric_grid(options.levels), uv_blend(options, creases)
        pieces = refined_primitives(control, control.cleaned, made.mesh, grid, blend, course)
        return [*_divided(control, control.cleaned, parts, made, pieces, meshes, pointers, options)]


def _able(control: ControlMesh, parts: Parts) -> Bool[np.ndarray, " P"]:
    """Return which parts have a face left, and an extent to measure by."""
    proper = np.concatenate(control.kept)
    points = control.weld.points[control.weld.faces]
    low, high = np.full((parts.count, 3), np.inf), np.full((parts.count, 3), -np.inf)
    np.minimum.at(low, parts.of_face[proper], points[proper].min(axis=1))
    np.maximum.at(high, parts.of_face[proper], points[proper].max(axis=1))
    extended: Bool[np.ndarray, " P"] = np.any(high > low, axis=1)
    return extended


def _smoothed(
    control: ControlMesh,
    cleaned: Cleaned,
    parts: Parts,
    creases: Creases,
    options: Options,
) -> tuple[ControlMesh, Parts]:
    """Return the union with new normals, for which vertices are split into more rows."""
    primitives = with_smooth_normals(control, cleaned, creases.left_after(options.levels))
    of_row = np.concatenate(
        [
            parts.of_row[share][primitive.rows]
            for share, primitive in zip(control.rows, primitives, strict=True)
        ]
    )
    return control.with_new_normals(primitives), replace(parts, of_row=of_row)


def _chosen_together(
    chosen: Bool[np.ndarray, " P"],
    meshes: Sequence[Sequence[TrianglePrimitive]],
    pointers: Sequence[str],
    scheme: Scheme,
    options: Options,
    course: Course,
    shares: StageShares,
) -> list[Part | None]:
    """Refine some of the meshes together; None for the others."""
    made: list[Part | None] = [None] * len(meshes)
    places = np.flatnonzero(chosen).tolist()
    if places:
        own, theirs = [meshes[place] for place in places], [pointers[place] for place in places]
        parts = refine_together(own, theirs, scheme, options, course, shares)
        for place, part in zip(places, parts, strict=True):
            made[place] = part
    return made


def _refined(
    control: ControlMesh,
    parts: Parts,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    course: Course,
) -> _Refined | None:
    """Refine the union; None where the compiled kernels cannot.

    Raises:
        MeshError: the refined coordinates of any part are too large.
    """
    cleaned = control.cleaned
    if cleaned is None:
        return None
    faces = parts.count_faces(cleaned.face_map >= 0)
    union, of_parts, length = cleaned.mesh, np.cumsum([0, *faces]), options.reference_length

    def refined_to(levels: int, limit: bool = False) -> PartsRefinement | None:
        return refine_parts(union, of_parts, scheme, levels, length, limit=limit, creases=creases)

    made = refined_to(options.levels, options.limit)
    if made is None:
        return None
    if leaves_single_precision(made.mesh.vertices):
        raise MeshError("refined positions leave the range of float32", element="vertices")
    skin_and_morph, cut = _skin_and_morph(control, cleaned, parts, creases, made, options, course)
    scalars = vertex_scalars(made, refined_to, scheme, options)
    refinement = Refinement(made.mesh, Deferred(lambda: made.reports[0]), made.ratio, made.gate)
    normals = made.normals if options.normals == "limit" else None
    return _Refined(RefinedMesh(refinement, skin_and_morph, scalars, normals), made.reports, cut)


def _skin_and_morph(
    control: ControlMesh,
    cleaned: Cleaned,
    parts: Parts,
    creases: Creases,
    made: PartsRefinement,
    options: Options,
    course: Course,
) -> tuple[SkinAndMorph, Int[np.ndarray, " P"]]:
    """Return what follows the refined vertices, and how many of each part lost a joint."""
    if not control.skin_and_morph.any:
        return control.skin_and_morph, np.zeros(parts.count, dtype=np.int64)
    rows = vertex_rows(control, cleaned)
    own, before = control.skin_and_morph.take(rows), parts.of_row[rows]
    table = None
    if own.binding is not None:
        table, binding = local_joints(own.binding, before, parts.count)
        own = replace(own, binding=binding)
    mesh = cleaned.mesh
    count = len(mesh.vertices)
    linear = linear_refinement(mesh.faces, count, options.levels, creases, limit=options.limit)
    slots = common_slots(control, cleaned, made.mesh.faces, len(made.mesh.vertices))
    after = refine_skin_and_morph(own, linear, slots, course)
    part_of = np.empty(len(made.mesh.vertices), dtype=np.int64)
    # Descendants lie as their faces do.
    part_of[made.mesh.faces] = np.repeat(
        before[mesh.faces[:, 0]], len(made.mesh.faces) // len(mesh.faces)
    )[:, None]
    if table is not None and after.binding is not None:
        after = replace(after, binding=table.named(after.binding, part_of))
    return after, np.bincount(part_of[after.cut], minlength=parts.count)


def _divided(
    control: ControlMesh,
    cleaned: Cleaned,
    parts: Parts,
    made: _Refined,
    pieces: Sequence[RefinedPrimitive],
    meshes: Sequence[Sequence[TrianglePrimitive]],
    pointers: Sequence[str],
    options: Options,
) -> list[Part]:
    """Return the union's refined primitives, cut into those of its parts."""
    copied = (cleaned.representative >= 0) & (cleaned.face_map < 0)
    copies = parts.count_faces(copied).tolist()
    refined: list[list[RefinedPrimitive]] = [[] for _ in meshes]
    # A primitive that has no face left in any part is not among the pieces.
    for piece in pieces:
        place = piece.source.number
        own = [primitives[place] for primitives in meshes]
        kept = _shares(control.kept[place], own)
        counts = np.array([int(keep.sum()) for keep in kept]) * 4**options.levels
        sources = own if options.normals == "keep" else [_with_normals(p) for p in own]
        for into, cut in zip(refined, divided(piece, counts, sources), strict=True):
            if len(cut.faces):
                into.append(cut)
    kept = [
        _shares(keep, [primitives[place] for primitives in meshes])
        for place, keep in enumerate(control.kept)
    ]
    lengths = [report["reference_length"] for report in made.reports]
    part_of = parts.of_row[vertex_rows(control, cleaned)]
    misses = near_misses(cleaned.mesh, lengths, part_of)
    return [
        Part(
            refined=refined[part],
            kept=[keep[part] for keep in kept],
            copies=copies[part],
            report=made.reports[part],
            changes=[
                change
                for primitive, keep in zip(primitives, kept, strict=True)
                for change in changes_of_primitive(
                    primitive, keep[part], options.levels, pointers[part]
                )
            ]
            + changes_of_vertices(int(control.near[part]), int(made.cut[part]), pointers[part])
            + change_of(misses[part], pointers[part]),
        )
        for part, primitives in enumerate(meshes)
    ]


def _shares(
    kept: Bool[np.ndarray, " F"], primitives: Sequence[TrianglePrimitive]
) -> list[Bool[np.ndarray, " f"]]:
    """Return each part's share of what says of a primitive's faces whether they were kept."""
    return [kept[share] for share in slices([len(primitive.corners) for primitive in primitives])]


def _with_normals(primitive: TrianglePrimitive) -> TrianglePrimitive:
    """Return the primitive, described as one that has normals."""
    accessors = with_normal_accessor(primitive.accessors, len(primitive.rows))
    return replace(primitive, accessors=accessors)
