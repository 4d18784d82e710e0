"""Refine control meshes with the operator: one mesh, or the parts of a union."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.crease_lines import named_on_parts
from pns_common.errors import MeshError
from pns_common.masks.linear import level_topologies
from pns_common.mesh import Mesh
from pns_common.refine import Report, refine
from pns_common.refine_parts import refine_parts
from pns_common.schemes import Scheme

from ...course import Course
from ...errors import UnrefinableError
from ...meshes.arrays import extent
from ...meshes.far_from_origin import STEPS, faces_too_far
from ...meshes.shape_creases import creases_by_shape
from ...options import Options
from ...report import Change
from ..read.primitives import TrianglePrimitive
from .columns import SkinAndMorph, refined_skin_and_morph
from .control_mesh import ControlMesh, Parts
from .new_normals import hard_edges

RATIO, GATE = "_PNS_RATIO", "_PNS_GATE"


class Made(Protocol):
    """A refined mesh, and what the last level did at each of its vertices."""

    @property
    def mesh(self) -> Mesh:
        """The refined mesh."""
        ...

    @property
    def ratio(self) -> Float[np.ndarray, " V"]:
        """Proximity ratio."""
        ...

    @property
    def gate(self) -> Float[np.ndarray, " V"]:
        """Gate γ."""
        ...

    @property
    def normals(self) -> Float[np.ndarray, "V 3"] | None:
        """Normals of the limit surface, if the vertices lie on it."""
        ...


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """A refined control mesh; arrays have a row for each refined vertex.

    Attributes:
        mesh: the refined mesh.
        reports: of the operator, one for each part.
        skin_and_morph: skin binding and morph deltas.
        cut: (P,) vertices of each part that lost a joint for lack of slots.
        scalars: further attributes by name.
        limit_normals: normals to use in place of those of the faces; None: none.
    """

    mesh: Mesh
    reports: list[Report]
    skin_and_morph: SkinAndMorph
    cut: Int[np.ndarray, " P"]
    scalars: dict[str, Float[np.ndarray, " V"]]
    limit_normals: Float[np.ndarray, "V 3"] | None


def creases_of(
    control: ControlMesh, options: Options, scheme: Scheme, parts: Parts | None = None
) -> Creases:
    """Return the edges of the mesh to refine that the options keep sharp.

    They are named if others than the operator need them; otherwise the operator finds them.
    """
    if control.is_empty:
        return NO_CREASES
    if options.crease == "normals":
        return Creases(hard_edges(control))
    creases = creases_by_shape(control.mesh, options, scheme)
    if creases.line_angle is None:
        return creases
    if not (control.skin_and_morph.any or options.normals != "keep" or options.uv == "smooth"):
        return creases
    return named_on_parts(control.mesh, creases, *control.part_of_face(parts))


def refined_mesh(
    control: ControlMesh,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    pointer: str,
    course: Course,
) -> RefinedMesh:
    """Refine a control mesh that has faces.

    Raises:
        UnrefinableError: refined positions leave the range of float32.
    """
    mesh, length = control.mesh, options.reference_length
    try:
        made = refine(
            mesh,
            scheme,
            options.levels,
            length,
            limit=options.limit,
            creases=creases,
            progress=lambda done, total: course.reach(done / total),
        )
        _check_range(made.mesh)
    except MeshError as error:
        raise UnrefinableError(str(error), pointer=pointer) from error
    return RefinedMesh(
        made.mesh,
        # Read now: until then the tables of the levels are kept.
        [made.report],
        *refined_skin_and_morph(control, made.mesh.faces, creases, options, course),
        _scalars(
            made,
            lambda levels: refine(mesh, scheme, levels, length, creases=creases),
            scheme,
            options,
        ),
        made.normals if options.normals == "limit" else None,
    )


def refined_union(
    control: ControlMesh,
    parts: Parts,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    course: Course,
) -> RefinedMesh | None:
    """Refine the parts of a union, each to the bits that it has alone; None without kernels.

    Raises:
        MeshError: refined positions of a part leave the range of float32.
    """
    faces = parts.count_faces(control.cleaned.face_map >= 0)
    union, of_parts, length = control.mesh, np.cumsum([0, *faces]), options.reference_length
    made = refine_parts(
        union, of_parts, scheme, options.levels, length, limit=options.limit, creases=creases
    )
    if made is None:
        return None
    _check_range(made.mesh)
    return RefinedMesh(
        made.mesh,
        made.reports,
        *refined_skin_and_morph(control, made.mesh.faces, creases, options, course, parts),
        _scalars(
            made,
            lambda levels: refine_parts(union, of_parts, scheme, levels, length, creases=creases),
            scheme,
            options,
        ),
        made.normals if options.normals == "limit" else None,
    )


def _check_range(mesh: Mesh) -> None:
    """Check that positions fit into float32. Raises MeshError."""
    low, high = extent(mesh.vertices)
    if max(-low.min(), high.max()) > np.finfo(np.float32).max:
        raise MeshError("refined positions leave the range of float32")


def _scalars(
    made: Made, again: Callable[[int], Made | None], scheme: Scheme, options: Options
) -> dict[str, Float[np.ndarray, " W"]]:
    """Return ratio and gate for `diagnostics=full`; otherwise nothing.

    They are those of the last learned level, for which `again` refines once more to fewer levels.
    A vertex that a later level puts on an edge has the mean of its ends.
    """
    if options.diagnostics != "full":
        return {}
    learned = scheme.learned_levels or options.levels
    acted = again(learned) if learned < options.levels else None
    if acted is None:
        return {RATIO: made.ratio, GATE: made.gate}
    values = np.stack([acted.ratio, acted.gate], axis=1)
    for topology in level_topologies(acted.mesh.faces, len(values), options.levels - learned):
        values = np.concatenate([values, values[topology.edges].mean(axis=1)])
    return {RATIO: values[:, 0], GATE: values[:, 1]}


def changes_of_primitive(
    primitive: TrianglePrimitive, kept: Bool[np.ndarray, " F"], levels: int, pointer: str
) -> list[Change]:
    """Return the dropped faces of a primitive of the mesh at `pointer`, and those too far away."""
    pointer = f"{pointer}/primitives/{primitive.number}"
    if not kept.any():
        return [Change(pointer, "left as it was: no face has an area", len(kept))]
    dropped = int((~kept).sum())
    faces = primitive.corners if dropped == 0 else primitive.corners[kept]
    far = faces_too_far(primitive.attributes["POSITION"], faces, levels)
    counts = {
        "degenerate faces dropped": dropped,
        f"faces too far from the origin: a side has fewer than {STEPS} steps of float32": far,
    }
    return [Change(pointer, what, count) for what, count in counts.items() if count]


def changes_of_vertices(near: int, cut: int, pointer: str) -> list[Change]:
    """Return the number of joined vertices of a mesh, and of refined ones that lost a joint."""
    counts = {
        "vertices joined within weld_tolerance": near,
        "refined vertices that lost their lightest joints": cut,
    }
    return [Change(pointer, what, count) for what, count in counts.items() if count]
