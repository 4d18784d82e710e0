"""Refine a mesh file without a glTF between: positions stay doubles, and labels stay with faces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pns_common.errors import MeshError
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import fans
from pns_common.mesh.rows import marked
from pns_common.operator.scheme import Scheme

from ..errors import UnrefinableError, check_limit
from ..gltf.read.plan import (
    BYTES_FOR_LIMIT,
    BYTES_FOR_NORMALS,
    BYTES_PER_FACE,
    BYTES_PER_VERTEX_BYTE,
    MeshPlan,
    check_memory,
)
from ..gltf.refine.control_mesh import ControlMesh
from ..gltf.refine.meshes import refine_alone, stage_shares
from ..gltf.refine.new_normals import MOST, are_one
from ..gltf.write import compression
from ..options import Limits, Options
from ..report import MeshResult, build_report
from ..stages import Stages
from .mesh_file import NONE, NORMAL, MeshFile
from .parts import chosen_of, joined, parts_of, with_group_normals
from .polygons import Refined, refine_polygons


def refine_mesh_file(
    mesh: MeshFile,
    scheme: Scheme,
    options: Options,
    limits: Limits,
    stages: Stages | None = None,
    *,
    traced: bool = False,
) -> tuple[MeshFile, dict[str, Any]]:
    """Refine triangles, or polygons where the scheme is one of polygons; return also the report.

    `normals=auto` adds none to a mesh without, keeps those that there are, and makes new ones where
    these are flat and no edge is to stay sharp. `traced` asks for the parents of
    vertices.

    Raises:
        LimitError: over `max_faces` or `max_memory_bytes`.
        UnrefinableError: no face that has an area, or one that cannot be refined.
    """
    stages = Stages() if stages is None else stages
    check_cost(mesh, options, limits)
    grouped = with_group_normals(mesh)
    if options.normals == "auto":
        smooth = options.crease == "off" and _is_flat(grouped)
        options = replace(options, normals="smooth" if smooth else "keep")
    try:
        if scheme.base.polygons:
            made = refine_polygons(grouped, scheme, options, limits, stages, traced=traced)
        else:
            made = _refine_triangles(grouped, scheme, options, limits, stages, traced=traced)
    except MeshError as error:
        raise UnrefinableError(str(error)) from error
    if NORMAL not in mesh.layers and options.normals == "keep":
        # Those that smoothing groups gave: these stay themselves.
        layers = {name: own for name, own in made.mesh.layers.items() if name != NORMAL}
        made = replace(made, mesh=replace(made.mesh, layers=layers))
    result = MeshResult(
        index=0,
        instances=1,
        primitives=made.primitives,
        vertices=len(made.mesh.vertices),
        faces=len(made.mesh.sizes),
        degenerate=made.degenerate,
        copies=made.copies,
        report=made.report,
        bends=made.bends,
    )
    used = marked(mesh.corners, len(mesh.vertices))
    used[made.corners] = False
    changes = [*mesh.changes, *made.changes]
    report = build_report(scheme, options.levels, [result], int(used.sum()), changes)
    return made.mesh, report


def _is_flat(mesh: MeshFile) -> bool:
    """Return whether there are normals, and most faces have one."""
    layer = mesh.layers.get(NORMAL)
    if layer is None or (layer.rows < 0).any():
        return False
    return bool(are_one(layer.values[layer.rows][fans(mesh.offsets)[0]]).mean() > MOST)


def _refine_triangles(
    mesh: MeshFile,
    scheme: Scheme,
    options: Options,
    limits: Limits,
    stages: Stages,
    *,
    traced: bool,
) -> Refined:
    parts, incomplete = parts_of(mesh)
    plan = MeshPlan(0, tuple(range(len(parts))), len(mesh.faces))
    primitives = [part.primitive for part in parts]
    chosen = chosen_of(mesh, options)
    own = None if chosen is None else [chosen[part.faces] for part in parts]
    shares = stage_shares(scheme, options)
    made = refine_alone(
        plan,
        primitives,
        scheme,
        options,
        stages,
        shares,
        traced=traced,
        chosen=own,
        stated=_stated(mesh, options),
        limits=limits,
    )
    if made.report is None:
        raise UnrefinableError("no face has three different vertices")
    parents = made.parents
    if parents is not None:
        rows = np.concatenate([primitive.rows for primitive in made.primitives])
        shape = (parents.shape[0], len(mesh.vertices))
        parents = replace(parents, columns=rows[parents.columns], shape=shape)
    kept = [part.faces[keep] for part, keep in zip(parts, made.kept, strict=True)]
    return Refined(
        mesh=joined(mesh, parts, made.kept, made.refined, parents),
        corners=mesh.faces[np.concatenate(kept)].reshape(-1),
        primitives=len(made.refined),
        degenerate=made.degenerate,
        copies=made.copies,
        report=made.report,
        bends=made.bends,
        # There is no document for a pointer to point into.
        changes=[*incomplete, *(replace(change, pointer="") for change in made.changes)],
    )


def _stated(mesh: MeshFile, options: Options) -> Callable[[ControlMesh, Creases], Creases] | None:
    """Return how creases that a file states are found in its control mesh; None: not asked for."""
    tags = mesh.tags
    if tags is None or options.crease != "auto":
        return None

    def creases(control: ControlMesh, found: Creases) -> Creases:
        rows = np.concatenate([primitive.rows for primitive in control.primitives])
        welded = control.weld.vertex_of
        vertex_of = np.full(len(mesh.vertices), NONE)
        vertex_of[rows[welded >= 0]] = control.cleaned.vertex_map[welded[welded >= 0]]
        return tags.creases(control.mesh, vertex_of, found)

    return creases


def faces_after(mesh: MeshFile, options: Options) -> int:
    """Return how many faces a mesh file becomes: four of a triangle, a quad for each corner.

    Of a goal it is what is known of triangles.
    """
    if options.goals or (mesh.sizes == 3).all():
        return options.faces_after(len(mesh.corners) - 2 * len(mesh.sizes))
    return len(mesh.corners) * 4 ** (options.levels - 1)


def check_faces(mesh: MeshFile, options: Options, limits: Limits) -> int:
    """Check and return the number of refined faces. Raises LimitError."""
    faces = faces_after(mesh, options)
    check_limit("faces", faces, limits.max_faces, f"the refined file would have {faces} faces")
    return faces


def check_cost(mesh: MeshFile, options: Options, limits: Limits) -> None:
    """Check the refined faces and the memory that they will take. Raises LimitError."""
    faces = check_faces(mesh, options, limits)
    width = sum(layer.values.itemsize * layer.values.shape[1] for layer in mesh.layers.values())
    each = BYTES_PER_FACE + BYTES_PER_VERTEX_BYTE * width + BYTES_FOR_LIMIT * options.limit
    kept = options.normals == "keep" or (options.normals == "auto" and options.crease != "off")
    each += BYTES_FOR_NORMALS * (not kept)
    each += compression.BYTES_PER_FACE[options.compress]
    check_memory(faces * each, limits)
