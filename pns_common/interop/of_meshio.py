"""meshio.Mesh: blocks stay blocks; point, cell and field data and sets are kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from pns_common.errors import MeshError
from pns_common.interop.carried import CarriedMesh
from pns_common.mesh.mesh import fans
from pns_common.mesh.quads import QUAD


def read_meshio(mesh: Any) -> CarriedMesh:
    """Return the arrays of a meshio Mesh, its blocks one after another.

    Raises:
        MeshError: it has cells of another type.
    """
    other = sorted({block.type for block in mesh.cells} - {"triangle", "quad", "polygon"})
    if other or not mesh.cells:
        kinds = ", ".join(other) or "none"
        raise MeshError(f"cells of type {kinds}, expected triangle or quad", element="cells")
    blocks = [np.asarray(block.data, dtype=np.int64) for block in mesh.cells]
    degrees = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])
    corners = np.concatenate([block.reshape(-1) for block in blocks])
    faces = corners, np.concatenate([[0], np.cumsum(degrees)])
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
    sizes, degrees = zip(*(np.shape(block.data) for block in given.cells), strict=True)
    # A triangle's four children have as many each; a quad comes of each corner.
    degree = int(np.shape(refined.faces)[1])
    parts = np.array(degrees) if degree == QUAD else np.ones(len(degrees), dtype=np.int64)
    children = len(refined.faces) // int(np.dot(parts, sizes)) * parts
    starts = np.cumsum(children * sizes)[:-1]
    return type(given)(
        refined.vertices[:, : given.points.shape[1]],
        [("quad" if degree == QUAD else "triangle", f) for f in np.split(refined.faces, starts)],
        point_data=dict(refined.points),
        cell_data={name: np.split(values, starts) for name, values in refined.cells.items()},
        field_data=given.field_data,
        # Points keep their numbers.
        point_sets=given.point_sets,
        cell_sets={
            name: [_descendants(*each) for each in zip(blocks, children.tolist(), strict=True)]
            for name, blocks in given.cell_sets.items()
        },
        info=given.info,
    )


def _descendants(cells: Any, children: int) -> np.ndarray:
    """Return the refined cells of some cells of a block, of which readers may give None."""
    old = np.asarray([] if cells is None else cells, dtype=np.int64)
    return (children * old[:, None] + np.arange(children)).reshape(-1)
