"""Refined primitives of faces of several levels: ``tolerance``, ``max_faces`` and other goals.

Values of corners are blended linearly in each face of the control mesh. Skins and morph targets
follow the vertices' masks. Normals are those of the limit surface; where the file's part, on each
side those of the faces there.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from jaxtyping import Float, Int

from pns_common.adaptive.corners import Joined, join_corners
from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry.grid import rounded_rows
from pns_common.errors import MeshError, ParameterError
from pns_common.mesh.creases import Creases
from pns_common.mesh.rows import cross, distinct_rows
from pns_common.operator.scheme import Scheme
from pns_common.parallel import Blocks, available_threads
from pns_common.refinement import refine

from ...errors import InvalidParameter, UnrefinableError, check_limit
from ...meshes.uv_charts import linear_uv
from ...options import Limits, Options
from ...stages import Stages
from ..read.primitives import distinct_corners
from .attributes import RefinedPrimitive, Vertices, facing, refined_attributes, refined_target
from .columns import carried_skin_and_morph
from .control_mesh import ControlMesh, slices
from .mesh_refine import RefinedMesh, check_range
from .normals import safe_unit

# Blended normals that differ by less are of one smooth side.
SAME_SIDE = 1e-4
# Shares of a primitive's time after which corners are weighed, joined, and have normals.
WEIGHED, JOINED, SHADED = 0.25, 0.7, 0.9


def refine_to_goal(
    control: ControlMesh,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    limits: Limits,
    pointer: str,
    stages: Stages,
    *,
    traced: bool,
) -> tuple[AdaptiveRefinement, RefinedMesh]:
    """Refine a control mesh that has faces until the options' goal is reached.

    Raises:
        UnrefinableError: refined positions leave the range of float32.
        InvalidParameter: the goal cannot be reached.
        LimitError: that would take too many faces.
    """

    def watch(done: int, total: int) -> None:
        _check_faces(done, limits)
        stages.reach(done / total)

    try:
        made = cast(
            AdaptiveRefinement,
            refine(
                control.surface,
                scheme,
                None,
                options.reference_length,
                **options.goals,
                creases=creases,
                progress=watch,
            ),
        )
        if not control.primitives[0].is_double:
            check_range(made.mesh)
    except MeshError as error:
        raise UnrefinableError(str(error), pointer=pointer) from error
    except ParameterError as error:
        raise InvalidParameter(error.name, str(error)) from error
    skin_and_morph, cut, lost = carried_skin_and_morph(control, made, stages)
    return made, RefinedMesh(
        made.mesh,
        [made.report],
        skin_and_morph,
        cut,
        lost,
        {},
        made.normals,
        made.parents if traced else None,
        made.control.topology,
    )


def primitives_of(
    control: ControlMesh, made: AdaptiveRefinement, refined: RefinedMesh, stages: Stages
) -> list[RefinedPrimitive]:
    """Return the refined primitives of a control mesh."""
    ends, primitives = slices(control.kept_counts), list[RefinedPrimitive]()
    for number, rows in enumerate(ends):
        with stages.part(number / len(ends), (number + 1) / len(ends)):
            if rows.stop > rows.start:
                primitives.append(_primitive(control, number, rows, made, refined, stages))
    return primitives


def _check_faces(count: int, limits: Limits) -> None:
    detail = f"more than {limits.max_faces} faces: ask for less by tolerance or max_faces"
    check_limit("faces", count, limits.max_faces, detail)


def _primitive(
    control: ControlMesh,
    number: int,
    kept: slice,
    made: AdaptiveRefinement,
    refined: RefinedMesh,
    stages: Stages,
) -> RefinedPrimitive:
    primitive = control.primitives[number]
    before = primitive.corners[control.kept[number]]
    welded = control.weld.vertex_of[control.rows[number]]
    corners, row = distinct_corners(primitive, before, welded)
    faces, counts = _parts(control.face_of_kept[kept], made.face_parents)
    of_kept = np.repeat(np.arange(len(corners)), counts)
    # A copy of a face names the same vertices in another order, and may face the other way.
    place = control.cleaned.vertex_map[welded[row]][corners]
    own = control.mesh.faces[control.face_of_kept[kept]]
    match = (place[:, :, None] == own[:, None, :]).argmax(axis=2)
    turned = (match[:, 1] - match[:, 0]) % 3 == 2
    weights = np.take_along_axis(made.weights[faces], match[of_kept][:, None, :], axis=2)
    stages.reach(WEIGHED)
    vertices = made.mesh.faces[faces]
    over = turned[of_kept]
    weights[over], vertices[over] = weights[over][:, ::-1], vertices[over][:, ::-1]
    # Facing the other way, a face's corners are taken backwards.
    split = join_corners(vertices, corners[of_kept], weights)
    stages.reach(JOINED)
    blend, vertex = split.blend, split.vertex
    normals = None
    if "NORMAL" in primitive.attributes:
        old = primitive.attributes["NORMAL"][row].astype(np.float64)
        normals = _normals(split, safe_unit(blend.linear(old)), made)
    stages.reach(SHADED)
    blocks = Blocks(available_threads())
    positions = (
        made.mesh.vertices[vertex]
        if primitive.is_double
        else rounded_rows(made.mesh.vertices, vertex, blocks)
    )
    at = Vertices(
        row=row,
        vertex=control.cleaned.vertex_map[welded[row]],
        connectivity=blend,
        positions=positions,
        normals=None if normals is None else normals.astype(np.float32),
        exact_normals=normals if "TANGENT" in primitive.attributes else None,
        skin_and_morph=refined.skin_and_morph.take(vertex),
        morphed_normals=(None,) * len(refined.skin_and_morph.deltas),
    )
    attributes = refined_attributes(primitive, at, linear_uv)
    targets = [
        refined_target(primitive, at, attributes, target)
        for target in range(len(primitive.targets))
    ]
    written = RefinedPrimitive(primitive, split.faces, attributes, targets, vertex, counts)
    authored = control.authored or control.own is not None
    return facing(written, before if authored else None)


def _parts(
    of_kept: Int[np.ndarray, " P"], parents: Int[np.ndarray, " F"]
) -> tuple[Int[np.ndarray, " M"], Int[np.ndarray, " P"]]:
    """Return the refined faces of faces, one after the other, and how many each has."""
    begin, end = (np.searchsorted(parents, of_kept, side=side) for side in ("left", "right"))
    counts = end - begin
    first = np.repeat(begin - (np.cumsum(counts) - counts), counts)
    return first + np.arange(len(first)), counts


def _normals(
    split: Joined, blended: Float[np.ndarray, "N 3"], made: AdaptiveRefinement
) -> Float[np.ndarray, "N 3"]:
    """Return normals of rows: the surface's; where the file's part, those of the faces there."""
    if made.normals is None:
        raise ValueError("a goal gives normals")
    vertex = split.vertex
    keys = np.column_stack([vertex, np.rint(blended / SAME_SIDE).astype(np.int64)])
    side = distinct_rows(keys)
    _, first = np.unique(side, return_index=True)
    several = np.bincount(vertex[first], minlength=len(made.normals))[vertex] > 1
    points = made.mesh.vertices[vertex][split.faces]
    areas = cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    sums = np.zeros((int(side.max(initial=-1)) + 1, 3))
    for corner in range(3):
        np.add.at(sums, side[split.faces[:, corner]], areas)
    own = np.where(several[:, None], safe_unit(sums)[side], made.normals[vertex])
    return np.where((own == 0).all(axis=1)[:, None], blended, own)
