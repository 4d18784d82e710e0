"""Open3D's TriangleMesh: colours, texture coordinates, textures and materials are kept.

There are two classes of this name: of ``geometry``, and of ``t.geometry``, of tensors.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from pns_common.interop.carried import CarriedMesh


def read_open3d(mesh: Any) -> CarriedMesh:
    """Return the arrays of a TriangleMesh."""
    if hasattr(mesh, "vertex"):
        return _read_tensors(mesh)
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
    if hasattr(given, "vertex"):
        return _write_tensors(refined, given)
    made = type(given)(given)  # a copy, with its textures
    # The library's own vectors, by their class: it need not be imported.
    points = cast(Any, type(given.vertices))
    triangles = cast(Any, type(given.triangles))
    made.vertices = points(refined.vertices)
    made.triangles = triangles(np.asarray(refined.faces, dtype=np.int32))
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


def _read_tensors(mesh: Any) -> CarriedMesh:
    points = {name: values.cpu().numpy() for name, values in mesh.vertex.items()}
    cells = {name: values.cpu().numpy() for name, values in mesh.triangle.items()}
    vertices, faces = points.pop("positions").astype(np.float64), cells.pop("indices")
    for data in (points, cells):
        data.pop("normals", None)
    corners = {name: cells.pop(name) for name in ("texture_uvs",) if name in cells}
    return CarriedMesh(vertices, faces.astype(np.int64), points, corners, cells)


def _write_tensors(refined: CarriedMesh, given: Any) -> Any:
    made = given.clone()
    points = {"positions": refined.vertices, **refined.points}
    cells = {"indices": refined.faces, **refined.corners, **refined.cells}
    for name, data in (("vertex", points), ("triangle", cells)):
        here = getattr(made, name)
        had_normals = "normals" in here
        for key, values in data.items():
            kind = cast(Any, type(here[key]))
            here[key] = kind(np.ascontiguousarray(values), here[key].dtype, here[key].device)
        if had_normals:
            del here["normals"]
            getattr(made, f"compute_{name}_normals")()
    return made
