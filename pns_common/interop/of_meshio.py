"""meshio.Mesh of triangles: blocks stay blocks; point, cell and field data are kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from pns_common.errors import MeshError
from pns_common.interop.carried import CarriedMesh


def read_meshio(mesh: Any) -> CarriedMesh:
    """Return the arrays of a meshio Mesh, its blocks one after another.

    Raises:
        MeshError: it has cells of another type.
    """
    other = sorted({block.type for block in mesh.cells} - {"triangle"})
    if other or not mesh.cells:
        kinds = ", ".join(other) or "none"
        raise MeshError(f"cells of type {kinds}, expected triangle", element="cells")
    faces = np.concatenate([np.asarray(block.data, dtype=np.int64) for block in mesh.cells])
    points = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    cells = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    vertices = np.asarray(mesh.points, dtype=np.float64)
    if vertices.ndim == 2 and vertices.shape[1] == 2:  # a plane mesh
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    return CarriedMesh(vertices, faces, points, cells=cells)


def write_meshio(refined: CarriedMesh, given: Any) -> Any:
    """Return a mesh of the class of ``given``, in its blocks."""
    starts = np.cumsum([len(block.data) for block in given.cells])[:-1]
    # Every face has as many descendants.
    starts *= len(refined.faces) // sum(len(block.data) for block in given.cells)
    return type(given)(
        refined.vertices[:, : given.points.shape[1]],
        [("triangle", faces) for faces in np.split(refined.faces, starts)],
        point_data=dict(refined.points),
        cell_data={name: np.split(values, starts) for name, values in refined.cells.items()},
        field_data=given.field_data,
    )
