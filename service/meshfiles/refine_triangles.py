"""Refine a mesh file's triangles: weld, clean, refine once, and give the corners their UVs back."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pns_common.creases import Creases
from pns_common.errors import MeshError
from pns_common.mesh import Cleaned, Mesh, clean, repeated_vertex
from pns_common.refinement import Refinement, refine
from pns_common.rows import distinct_rows, number_by_first_appearance
from pns_common.schemes import Scheme

from ..advice import advice_on, count_bends
from ..course import Course
from ..errors import InvalidParameter, UnrefinableError, check_limit
from ..gltf.read.plan import BYTES_FOR_LIMIT, BYTES_PER_FACE, check_memory
from ..gltf.refine.control_mesh import refined_ids
from ..meshes.barycentric_grid import barycentric_grid
from ..meshes.shape_creases import creases_by_shape
from ..meshes.split_connectivity import split_connectivity
from ..meshes.uv_charts import uv_blend
from ..meshes.weld import Weld, weld
from ..meshes.weld_tolerance import weld_within
from ..options import Limits, Options
from ..report import Change, dropped
from .indexed_triangles import IndexedTriangles


def refine_triangles(
    mesh_file: IndexedTriangles,
    scheme: Scheme,
    options: Options,
    limits: Limits,
    course: Course | None = None,
) -> tuple[IndexedTriangles, dict[str, Any]]:
    """Refine the triangles; return also the report.

    Raises:
        LimitError: over `max_faces` or `max_memory_bytes`.
        UnrefinableError: a position that is no number, or no face that has an area.
        InvalidParameter: creases by normals, which these formats do not hand on.
    """
    check_cost(len(mesh_file.faces) * 4**options.levels, options, limits)
    if options.crease == "normals":
        raise InvalidParameter("crease", "crease=normals needs a glTF; use angle:DEGREES here")
    course = Course() if course is None else course
    control = _checked(mesh_file)
    exact = weld(control.vertices, control.faces)
    welded = weld_within(exact, options.weld_tolerance, options.weld_unit, None)
    proper = ~repeated_vertex(welded.faces)
    if not proper.any():
        raise UnrefinableError("no face has three different vertices")
    cleaned = clean(Mesh(welded.points, welded.faces))
    creases = creases_by_shape(cleaned.mesh, options, scheme)
    refinement = refine(
        cleaned.mesh,
        scheme,
        options.levels,
        options.reference_length,
        limit=options.limit,
        creases=creases,
        progress=lambda done, total: course.reach(done / total),
    )
    refined = _with_corners(mesh_file, welded, cleaned, refinement, options, creases)
    changes = [
        Change("", f"{name} dropped", count) for name, count in mesh_file.unsupported.items()
    ]
    if mesh_file.split:
        changes.append(Change("", "triangles added by splitting polygons", mesh_file.split))
    near = len(exact.points) - len(welded.points)
    if near:
        changes.append(Change("", "vertices joined within weld_tolerance", near))
    report = {name: value for name, value in refinement.report.items() if name != "levels"}
    report["totals"] = {
        "vertices": len(refined.vertices),
        "faces": len(refined.faces),
        "copied_faces": cleaned.dropped_duplicate,
        "zero_reference_lengths": int(report["reference_length"] == 0),
    }
    report["dropped"] = dropped(int((~proper).sum()), _unused_vertices(mesh_file, welded, cleaned))
    (bends,) = count_bends(cleaned.mesh, creases)
    levels = refinement.report["levels"]
    report["changes"] = [asdict(change) for change in changes]
    report["advice"] = advice_on(levels, bends)
    report["levels"] = levels
    return refined, report


def check_cost(faces: int, options: Options, limits: Limits) -> None:
    """Check refined faces and the memory that they take. Raises LimitError."""
    check_limit("faces", faces, limits.max_faces, f"the refined file would have {faces} faces")
    check_memory(faces * (BYTES_PER_FACE + BYTES_FOR_LIMIT * options.limit), limits)


def _checked(mesh_file: IndexedTriangles) -> Mesh:
    try:
        return Mesh(mesh_file.vertices, mesh_file.faces)
    except MeshError as error:
        raise UnrefinableError(str(error)) from error


def _unused_vertices(mesh_file: IndexedTriangles, welded: Weld, cleaned: Cleaned) -> int:
    """Count the file's vertices that no refined face uses."""
    used = welded.vertex_of >= 0
    stay = cleaned.vertex_map[welded.vertex_of[used]] >= 0
    return mesh_file.unused + len(used) - int(stay.sum())


def _with_corners(
    mesh_file: IndexedTriangles,
    welded: Weld,
    cleaned: Cleaned,
    refinement: Refinement,
    options: Options,
    creases: Creases,
) -> IndexedTriangles:
    """Cut the refined mesh open again where texture coordinates differ."""
    points, grid = refinement.mesh.vertices, barycentric_grid(options.levels)
    ids = refined_ids(welded, cleaned, refinement.mesh, grid)
    if mesh_file.uv is None:
        return IndexedTriangles(points, ids[:, grid.faces.reshape(-1)].reshape(-1, 3))
    faces = mesh_file.faces[cleaned.representative >= 0]
    corners, vertex, uv = _distinct_corners(faces, welded, mesh_file.uv)
    own = split_connectivity(corners, len(uv), grid)
    blended = uv_blend(options, creases)(own, cleaned.vertex_map[vertex], uv)
    return IndexedTriangles(points[own.at_vertices(ids)], own.refined_faces, blended)


def _distinct_corners(
    faces: Int[np.ndarray, "P 3"], welded: Weld, uv: Float[np.ndarray, "N 2"]
) -> tuple[Int[np.ndarray, "P 3"], Int[np.ndarray, " C"], Float[np.ndarray, "C 2"]]:
    """Return faces over distinct pairs of welded vertex and texture coordinates, and these."""
    rows = np.column_stack([welded.vertex_of.astype(np.float64), uv])
    flat = faces.reshape(-1)
    corners, first = number_by_first_appearance(distinct_rows(rows)[flat])
    row = flat[first]
    return corners.reshape(-1, 3), welded.vertex_of[row], uv[row]
