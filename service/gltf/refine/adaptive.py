"""Refine a control mesh to faces of several levels: `tolerance`, `max_faces` and other goals."""

from __future__ import annotations

from typing import cast

from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.errors import MeshError, ParameterError
from pns_common.mesh.creases import Creases
from pns_common.operator.scheme import Scheme
from pns_common.refinement import refine

from ...errors import InvalidParameter, UnrefinableError, check_limit
from ...options import Limits, Options
from ...stages import Stages
from .columns import refined_skin_and_morph
from .control_mesh import ControlMesh
from .mesh_refine import RefinedMesh, check_range
from .split import several_levels


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
) -> RefinedMesh:
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
    split = several_levels(control.faces, made.mesh.faces, made.face_parents, made.weights)
    return RefinedMesh(
        made.mesh,
        [made.report],
        refined_skin_and_morph(control, split, made.trail, stages),
        {},
        made.normals,
        split,
        made.parents if traced else None,
        made.control.topology,
    )


def _check_faces(count: int, limits: Limits) -> None:
    detail = f"more than {limits.max_faces} faces: ask for less by tolerance or max_faces"
    check_limit("faces", count, limits.max_faces, detail)
