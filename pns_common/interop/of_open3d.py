"""open3d.geometry.TriangleMesh: colours, texture coordinates, textures and materials are kept."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from pns_common.interop.carried import CarriedMesh


def read_open3d(mesh: Any) -> CarriedMesh:
    """Return the arrays of a TriangleMesh."""
    faces = np.asarray(mesh.triangles).astype(np.int64)
    points = {"colour": np.asarray(mesh.vertex_colors)} if mesh.has_vertex_colors() else {}
    corners: dict[str, np.ndarray] = {}
    if mesh.has_triangle_uvs():
        corners["uv"] = np.asarray(mesh.triangle_uvs).reshape(len(faces), 3, 2)
    cells: dict[str, np.ndarray] = {}
    if mesh.has_triangle_material_ids():
        cells["material"] = np.asarray(mesh.triangle_material_ids)
    return CarriedMesh(np.asarray(mesh.vertices), faces, points, corners, cells)


def write_open3d(refined: CarriedMesh, given: Any) -> Any:
    """Return a mesh of the class of ``given``; with normals where that has some."""
    made = type(given)(given)  # a copy, with its textures
    # The library's own vectors, by their class: it need not be imported.
    points = cast(Any, type(given.vertices))
    triangles = cast(Any, type(given.triangles))
    made.vertices = points(refined.vertices)
    made.triangles = triangles(refined.faces.astype(np.int32))
    made.vertex_colors = points(refined.points.get("colour", np.empty((0, 3))))
    if "uv" in refined.corners:
        made.triangle_uvs = type(given.triangle_uvs)(refined.corners["uv"].reshape(-1, 2))
    if "material" in refined.cells:
        made.triangle_material_ids = type(given.triangle_material_ids)(refined.cells["material"])
    made.vertex_normals, made.triangle_normals = points(), points()
    if given.has_vertex_normals():
        made.compute_vertex_normals()
    elif given.has_triangle_normals():
        made.compute_triangle_normals()
    return made
