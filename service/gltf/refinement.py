"""Refine one control mesh, and all that follows its vertices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Int

from pns_common.errors import MeshError
from pns_common.linear import level_topologies
from pns_common.mesh import Cleaned
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme
from service.errors import UnrefinableError
from service.gltf.control_mesh import ControlMesh, vertex_rows
from service.gltf.followers import Followers, refine_followers
from service.gltf.hard_edges import hard_edges
from service.gltf.report import Change
from service.gltf.share import RefinedMesh
from service.options import Options
from service.sharpness import edges_sharper_than

RATIO, GATE = "_PNS_RATIO", "_PNS_GATE"


def refine_control_mesh(
    control: ControlMesh,
    scheme: Scheme,
    options: Options,
    pointer: str,
    progress: Callable[[int, int], None] | None,
) -> RefinedMesh | None:
    """Refine a mesh whose positions will be written as float32; None if it has no face.

    Raises:
        UnrefinableError: the refined positions leave the range of float32.
    """
    if control.cleaned is None:
        return None
    mesh, length = control.cleaned.mesh, options.reference_length
    creases = _creases(control, control.cleaned, options)
    try:
        refinement = refine(
            mesh, scheme, options.levels, length, creases=creases, progress=progress
        )
    except MeshError as error:
        raise UnrefinableError(str(error), pointer=pointer) from error
    if np.abs(refinement.mesh.vertices).max() > np.finfo(np.float32).max:
        raise UnrefinableError("refined positions leave the range of float32", pointer=pointer)
    return RefinedMesh(
        refinement,
        _followers(control, control.cleaned, options.levels, creases),
        _scalars(refinement, options),
    )


def changes_of_mesh(
    control: ControlMesh, refined: RefinedMesh | None, pointer: str
) -> list[Change]:
    """What was joined, dropped or cut in a mesh."""
    changes = [
        Change(
            f"{pointer}/primitives/{primitive.number}",
            "degenerate faces dropped" if keep.any() else "left as it was: no face has an area",
            int((~keep).sum()),
        )
        for primitive, keep in zip(control.primitives, control.kept, strict=True)
        if not keep.all()
    ]
    if control.near:
        changes.append(Change(pointer, "vertices joined within weld_tolerance", control.near))
    if refined is not None and len(refined.followers.cut):
        cut = len(refined.followers.cut)
        changes.append(Change(pointer, "refined vertices that lost their lightest joints", cut))
    return changes


def _creases(
    control: ControlMesh, cleaned: Cleaned, options: Options
) -> Int[np.ndarray, "N 2"] | None:
    if options.crease == "normals":
        return hard_edges(control, cleaned)
    angle = options.crease_angle
    return None if angle is None else edges_sharper_than(cleaned.mesh, angle)


def _followers(
    control: ControlMesh, cleaned: Cleaned, levels: int, creases: Int[np.ndarray, "N 2"] | None
) -> Followers:
    if not control.followers.any:
        return control.followers
    at_vertices = control.followers.take(vertex_rows(control, cleaned))
    faces, count = cleaned.mesh.faces, len(cleaned.mesh.vertices)
    return refine_followers(at_vertices, level_topologies(faces, count, levels, creases))


def _scalars(refinement: Refinement, options: Options) -> dict[str, np.ndarray]:
    if options.diagnostics != "full":
        return {}
    return {RATIO: refinement.ratio, GATE: refinement.gate}
