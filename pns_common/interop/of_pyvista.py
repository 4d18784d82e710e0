"""pyvista.PolyData: point, cell and field data are kept and stay active, but for normals."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from pns_common.errors import MeshError
from pns_common.interop.carried import CarriedMesh


def read_pyvista(mesh: Any) -> CarriedMesh:
    """Return the arrays of a PolyData.

    Raises:
        MeshError: it has no faces, or polygons beside strips, or lines or points of their own.
    """
    if not (len(mesh.faces) or mesh.n_strips):
        raise MeshError("no faces to refine", element="faces")
    if mesh.n_lines or mesh.n_verts:
        # To triangulate it leaves the lines.
        what = f"lines ({mesh.n_lines}) and points ({mesh.n_verts}) of their own beside them"
        advice = "give pyvista.PolyData(mesh.points, mesh.faces)"
        raise MeshError(f"{what}; {advice}", element="faces")
    if mesh.n_strips and not mesh.is_all_triangles:
        raise MeshError("strips beside polygons; triangulate=True cuts them", element="faces")
    # Normals are those of the old surface: they are computed again where they are wanted.
    normals = {mesh.point_data.active_normals_name, mesh.cell_data.active_normals_name}
    points = {k: np.asarray(v) for k, v in mesh.point_data.items() if k not in normals}
    cells = {k: np.asarray(v) for k, v in mesh.cell_data.items() if k not in normals}
    faces = np.asarray(mesh.regular_faces, np.int64) if mesh.is_all_triangles else _polygons(mesh)
    return CarriedMesh(np.asarray(mesh.points, dtype=np.float64), faces, points, cells=cells)


def _polygons(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return corners and offsets of faces, which a PolyData has in a row, each behind its size."""
    padded, starts, at = np.asarray(mesh.faces, dtype=np.int64), list[int](), 0
    sizes = padded.tolist()
    while at < len(sizes):
        starts.append(at)
        at += sizes[at] + 1
    offsets = np.concatenate([[0], np.cumsum(padded[starts])])
    return np.delete(padded, starts), offsets


def write_pyvista(refined: CarriedMesh, given: Any) -> Any:
    """Return a PolyData of the class of ``given``."""
    kind = cast(Any, type(given))
    made = kind.from_regular_faces(refined.vertices, refined.faces)
    for name, values in refined.points.items():
        made.point_data[name] = values
    for name, values in refined.cells.items():
        made.cell_data[name] = values
    for name, values in given.field_data.items():
        made.field_data[name] = values
    for here, there in ((made.point_data, given.point_data), (made.cell_data, given.cell_data)):
        for kind in ("active_scalars_name", "active_vectors_name"):
            if (name := getattr(there, kind)) in here:
                setattr(here, kind, name)
    # Which of both the mesh shows.
    for kind in ("scalars", "vectors", "tensors"):
        shown = getattr(given, f"active_{kind}_info")
        data = made.cell_data if shown.association.name == "CELL" else made.point_data
        if shown.name in data:
            getattr(made, f"set_active_{kind}")(shown.name, shown.association.name.lower())
    texture = given.point_data.active_texture_coordinates_name
    if texture is not None:
        made.point_data.active_texture_coordinates_name = texture
    return made
