"""meshio.Mesh of triangles: blocks stay blocks; point, cell and field data and sets are kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from pns_common.errors import MeshError
from pns_common.interop.carried import CarriedMesh
from pns_common.mesh import fans


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


def triangulated_meshio(mesh: Any) -> Any:
    """Return the mesh with its quads and polygons cut into triangles; sets of cells are dropped."""
    cells, data = list[tuple[str, Any]](), {name: list[Any]() for name in mesh.cell_data}
    for number, block in enumerate(mesh.cells):
        kind, faces, parents = block.type, np.asarray(block.data), np.arange(len(block.data))
        if kind in {"quad", "polygon"}:
            count = int(faces.shape[1])
            rows, parents = fans(np.arange(0, faces.size + 1, count))
            kind, faces = "triangle", faces.reshape(-1)[rows]
        cells.append((kind, faces))
        for name, values in mesh.cell_data.items():
            data[name].append(np.asarray(values[number])[parents])
    more = {"point_data": mesh.point_data, "point_sets": mesh.point_sets, "info": mesh.info}
    return type(mesh)(mesh.points, cells, cell_data=data, field_data=mesh.field_data, **more)


def write_meshio(refined: CarriedMesh, given: Any) -> Any:
    """Return a mesh of the class of ``given``, in its blocks."""
    # Every face has as many descendants, one after another.
    children = len(refined.faces) // sum(len(block.data) for block in given.cells)
    starts = children * np.cumsum([len(block.data) for block in given.cells])[:-1]
    return type(given)(
        refined.vertices[:, : given.points.shape[1]],
        [("triangle", faces) for faces in np.split(refined.faces, starts)],
        point_data=dict(refined.points),
        cell_data={name: np.split(values, starts) for name, values in refined.cells.items()},
        field_data=given.field_data,
        # Points keep their numbers.
        point_sets=given.point_sets,
        cell_sets={
            name: [_descendants(block, children) for block in blocks]
            for name, blocks in given.cell_sets.items()
        },
        info=given.info,
    )


def _descendants(cells: Any, children: int) -> np.ndarray:
    """Return the refined cells of some cells of a block, of which readers may give None."""
    old = np.asarray([] if cells is None else cells, dtype=np.int64)
    return (children * old[:, None] + np.arange(children)).reshape(-1)
