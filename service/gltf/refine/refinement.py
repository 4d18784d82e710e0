"""Refine one control mesh, and all that follows its vertices."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pns_common.base.extent import extent
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.crease_lines import NO_PAIRS, named_on_parts
from pns_common.errors import MeshError
from pns_common.fused.where_loaded.linear import linear_refinement
from pns_common.mesh import Cleaned, Mesh
from pns_common.refine import refine
from pns_common.schemes import Scheme

from ...course import Course
from ...errors import UnrefinableError
from ...meshes.far_from_origin import STEPS, faces_too_far
from ...meshes.shape_creases import creases_by_shape
from ...options import Options
from ...report import Change
from ..read.primitives import TrianglePrimitive
from .common_slots import common_slots
from .control_mesh import ControlMesh, vertex_rows
from .drawn_borders import drawn_borders
from .face_parts import part_of_face
from .hard_edges import hard_edges
from .near_misses import change_of, near_misses
from .parts import Parts
from .refined_primitives import RefinedMesh, is_double
from .shaded_edges import shaded_edges
from .skin_and_morph import SkinAndMorph, refine_skin_and_morph
from .where_acted import vertex_scalars


def creases_of(
    control: ControlMesh, options: Options, scheme: Scheme, parts: Parts | None = None
) -> Creases:
    """Return the cleaned mesh's edges that the options keep sharp; `parts` as in `control_mesh`.

    By name where others than the operator have to know them; it finds lines on its way.
    """
    cleaned = control.cleaned
    if cleaned is None:
        return NO_CREASES
    if options.crease == "normals":
        return Creases(hard_edges(control, cleaned))
    creases = creases_by_shape(cleaned.mesh, options, scheme)
    if creases.line_angle is None:
        return creases
    part = part_of_face(control, cleaned, parts)
    hard = smooth = borders = NO_PAIRS
    if options.crease == "auto":
        hard, smooth = shaded_edges(control, cleaned, *part)
        # No line ends or goes on by what is drawn beside it.
        borders = drawn_borders(control, cleaned)
    shown = len(hard) + len(smooth) + len(borders) > 0
    known = control.skin_and_morph.any or options.normals != "keep" or options.uv == "smooth"
    if not (shown or known):
        return creases
    lines = named_on_parts(cleaned.mesh, creases, *part, smooth)
    return lines.with_named(hard).with_named(borders)


def refine_control_mesh(
    control: ControlMesh,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    pointer: str,
    course: Course,
) -> RefinedMesh | None:
    """Refine a mesh whose positions will be written as float32; None if it has no face.

    `creases` are edges of the cleaned mesh.

    Raises:
        UnrefinableError: the refined positions leave the range of float32.
    """
    if control.cleaned is None:
        return None
    mesh, length = control.cleaned.mesh, options.reference_length
    try:
        refinement = refine(
            mesh,
            scheme,
            options.levels,
            length,
            limit=options.limit,
            creases=creases,
            progress=lambda done, total: course.reach(done / total),
        )
    except MeshError as error:
        raise UnrefinableError(str(error), pointer=pointer) from error
    double = is_double(control.primitives[0])
    if not double and leaves_single_precision(refinement.mesh.vertices):
        raise UnrefinableError("refined positions leave the range of float32", pointer=pointer)
    scalars = vertex_scalars(
        refinement,
        lambda levels: refine(mesh, scheme, levels, length, creases=creases),
        scheme,
        options,
    )
    return RefinedMesh(
        refinement,
        _skin_and_morph(control, control.cleaned, refinement.mesh, options, creases, course),
        scalars,
        refinement.normals if options.normals == "limit" else None,
    )


def leaves_single_precision(points: Float[np.ndarray, "V 3"]) -> bool:
    """Return whether a coordinate is too large for float32."""
    low, high = extent(points)
    return max(-low.min(), high.max()) > np.finfo(np.float32).max


def changes_of_mesh(
    control: ControlMesh, refined: RefinedMesh | None, levels: int, pointer: str
) -> list[Change]:
    """Return what was joined, dropped or cut in a mesh, and is written too coarsely."""
    changes = [
        change
        for primitive, keep in zip(control.primitives, control.kept, strict=True)
        for change in changes_of_primitive(primitive, keep, levels, pointer)
    ]
    (near,) = control.near.tolist()
    cut = 0 if refined is None else len(refined.skin_and_morph.cut)
    changes += changes_of_vertices(near, cut, pointer)
    if refined is not None and control.cleaned is not None:
        length = refined.refinement.report["reference_length"]
        (misses,) = near_misses(control.cleaned.mesh, [length])
        changes += change_of(misses, pointer)
    return changes


def changes_of_vertices(near: int, cut: int, pointer: str) -> list[Change]:
    """Return what was joined of a mesh's vertices, and how many refined ones lost a joint."""
    changes: list[Change] = []
    if near:
        changes.append(Change(pointer, "vertices joined within weld_tolerance", near))
    if cut:
        changes.append(Change(pointer, "refined vertices that lost their lightest joints", cut))
    return changes


def changes_of_primitive(
    primitive: TrianglePrimitive, kept: Bool[np.ndarray, " F"], levels: int, pointer: str
) -> list[Change]:
    """Return what was dropped of a primitive of the mesh at `pointer`, and is too far away."""
    pointer = f"{pointer}/primitives/{primitive.number}"
    if not kept.any():
        return [Change(pointer, "left as it was: no face has an area", len(kept))]
    dropped = int((~kept).sum())
    faces = primitive.corners if dropped == 0 else primitive.corners[kept]
    far = 0
    if not is_double(primitive):
        far = faces_too_far(primitive.attributes["POSITION"], faces, levels)
    told = {
        "degenerate faces dropped": dropped,
        f"faces too far from the origin: a side has fewer than {STEPS} steps of float32": far,
    }
    return [Change(pointer, what, count) for what, count in told.items() if count]


def _skin_and_morph(
    control: ControlMesh,
    cleaned: Cleaned,
    refined: Mesh,
    options: Options,
    creases: Creases,
    course: Course,
) -> SkinAndMorph:
    if not control.skin_and_morph.any:
        return control.skin_and_morph
    at_vertices = control.skin_and_morph.take(vertex_rows(control, cleaned))
    faces, count = cleaned.mesh.faces, len(cleaned.mesh.vertices)
    linear = linear_refinement(faces, count, options.levels, creases, limit=options.limit)
    slots = common_slots(control, cleaned, refined.faces, len(refined.vertices))
    return refine_skin_and_morph(at_vertices, linear, slots, course)
