"""Refine a mesh file's triangles: weld, clean, refine once, and give the corners their UVs back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pns_common.errors import MeshError
from pns_common.mesh import Cleaned, Mesh, clean, repeated_vertex
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme
from service.errors import InvalidParameter, UnrefinableError, check_limit
from service.gltf.charts import uv_blend
from service.gltf.lattice import lattice
from service.gltf.plan import BYTES_PER_FACE, check_memory
from service.gltf.report import Change, dropped
from service.gltf.share import refined_ids
from service.gltf.spread import spread
from service.nearness import weld_within
from service.options import Limits, Options
from service.sharpness import edges_sharper_than
from service.soup import TriangleSoup
from service.weld import Weld, distinct_rows, number_by_first_appearance, weld


def refine_soup(
    soup: TriangleSoup,
    scheme: Scheme,
    options: Options,
    limits: Limits,
    progress: Callable[[int, int], None] | None,
) -> tuple[TriangleSoup, dict[str, Any]]:
    """The refined triangles and the report.

    Raises:
        LimitError: over `max_faces` or `max_memory_bytes`.
        UnrefinableError: a position that is no number, or no face that has an area.
        InvalidParameter: creases by normals, which these formats do not hand on.
    """
    _check_cost(len(soup.faces) * 4**options.levels, limits)
    if options.crease == "normals":
        raise InvalidParameter("crease", "crease=normals needs a glTF; use angle:DEGREES here")
    control = _checked(soup)
    exact = weld(control.vertices, control.faces)
    welded = weld_within(exact, options.weld_tolerance, options.weld_unit, None)
    proper = ~repeated_vertex(welded.faces)
    if not proper.any():
        raise UnrefinableError("no face has three different vertices")
    cleaned = clean(Mesh(welded.points, welded.faces))
    angle = options.crease_angle
    refinement = refine(
        cleaned.mesh,
        scheme,
        options.levels,
        options.reference_length,
        creases=None if angle is None else edges_sharper_than(cleaned.mesh, angle),
        progress=progress,
    )
    ids = refined_ids(welded, cleaned, refinement, lattice(options.levels))
    refined = _with_corners(soup, welded, proper, ids, refinement, options)
    changes = [Change("", f"{name} dropped", count) for name, count in soup.left_out.items()]
    if soup.split:
        changes.append(Change("", "triangles added by splitting polygons", soup.split))
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
    report["dropped"] = dropped(int((~proper).sum()), _unused_vertices(soup, welded, cleaned))
    report["changes"] = [asdict(change) for change in changes]
    report["levels"] = refinement.report["levels"]
    return refined, report


def _check_cost(faces: int, limits: Limits) -> None:
    check_limit("faces", faces, limits.max_faces, f"the refined file would have {faces} faces")
    check_memory(faces * BYTES_PER_FACE, limits)


def _checked(soup: TriangleSoup) -> Mesh:
    try:
        return Mesh(soup.vertices, soup.faces)
    except MeshError as error:
        raise UnrefinableError(str(error)) from error


def _unused_vertices(soup: TriangleSoup, welded: Weld, cleaned: Cleaned) -> int:
    """How many of the file's vertices no refined face uses."""
    used = welded.vertex_of >= 0
    stay = cleaned.vertex_map[welded.vertex_of[used]] >= 0
    return soup.unused + len(used) - int(stay.sum())


def _with_corners(
    soup: TriangleSoup,
    welded: Weld,
    proper: np.ndarray,
    ids: Int[np.ndarray, "P T"],
    refinement: Refinement,
    options: Options,
) -> TriangleSoup:
    """The refined mesh, cut open again where texture coordinates differ."""
    points = refinement.mesh.vertices
    grid = lattice(options.levels)
    if soup.uv is None:
        return TriangleSoup(points, ids[:, grid.faces.reshape(-1)].reshape(-1, 3))
    corners, vertex, uv = _distinct_corners(soup.faces[proper], welded, soup.uv)
    own = spread(corners, len(uv), grid)
    blended = uv_blend(options)(own, vertex, uv)
    return TriangleSoup(points[own.at_vertices(ids)], own.refined_faces, blended)


def _distinct_corners(
    faces: Int[np.ndarray, "P 3"], welded: Weld, uv: Float[np.ndarray, "N 2"]
) -> tuple[Int[np.ndarray, "P 3"], Int[np.ndarray, " C"], Float[np.ndarray, "C 2"]]:
    """Faces over the distinct pairs of a welded vertex and texture coordinates, and these."""
    rows = np.column_stack([welded.vertex_of.astype(np.float64), uv])
    corners = number_by_first_appearance(distinct_rows(rows)[faces.reshape(-1)])
    row = np.empty(corners.max() + 1, dtype=np.int64)
    row[corners] = faces.reshape(-1)
    return corners.reshape(-1, 3), welded.vertex_of[row], uv[row]
