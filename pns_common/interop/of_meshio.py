"""meshio.Mesh: blocks stay blocks; point, cell and field data and sets are kept.

Lines along edges are refined with them, and vertices stay, as gmsh writes both beside faces.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pns_common.errors import MeshError
from pns_common.interop.carried import NO_LINES, CarriedMesh
from pns_common.mesh.mesh import fans
from pns_common.mesh.rows import ranges
from pns_common.mesh.topology import QUAD

FACES, LINE, VERTEX = frozenset({"triangle", "quad", "polygon"}), "line", "vertex"


def read_meshio(mesh: Any) -> CarriedMesh:
    """Return the arrays of a meshio Mesh, its blocks of faces one after another.

    Raises:
        MeshError: it has no faces, or cells of another type.
    """
    other = sorted({block.type for block in mesh.cells} - FACES - {LINE, VERTEX})
    faces = [number for number, block in enumerate(mesh.cells) if block.type in FACES]
    if other or not faces:
        kinds = ", ".join(other) or "none"
        advice = "give meshio.Mesh(mesh.points, the blocks of faces)" if other and faces else ""
        expected = "expected triangle or quad, and line or vertex beside them"
        what = f"cells of type {kinds}, {expected}" + (f"; {advice}" if advice else "")
        raise MeshError(what, element="cells")
    blocks = [np.asarray(mesh.cells[number].data, dtype=np.int64) for number in faces]
    degrees = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])
    corners = np.concatenate([block.reshape(-1) for block in blocks])
    points = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    cells = {
        name: np.concatenate([np.asarray(values[number]) for number in faces])
        for name, values in mesh.cell_data.items()
    }
    vertices = np.asarray(mesh.points, dtype=np.float64)
    if vertices.ndim == 2 and vertices.shape[1] == 2:  # a plane mesh
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    lines = [np.asarray(block.data, np.int64) for block in mesh.cells if block.type == LINE]
    return CarriedMesh(
        vertices,
        (corners, np.concatenate([[0], np.cumsum(degrees)])),
        points,
        cells=cells,
        lines=np.concatenate([NO_LINES, *lines]),
    )


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
    degree, row, line = int(np.shape(refined.faces)[1]), 0, 0
    sizes = {n: np.shape(b.data) for n, b in enumerate(given.cells) if b.type in FACES}
    # A triangle's four children have as many each; a quad comes of each corner.
    parts = {number: width if degree == QUAD else 1 for number, (_, width) in sizes.items()}
    each = len(refined.faces) // sum(parts[number] * count for number, (count, _) in sizes.items())
    blocks: list[tuple[str, np.ndarray]] = []
    # The cell of its block that each cell is a part of, and where those of faces begin.
    parents: list[np.ndarray] = []
    begins: list[int] = []
    for number, block in enumerate(given.cells):
        count, kind = len(block.data), block.type
        begins.append(row)
        if kind in FACES:
            children = each * parts[number]
            own = refined.faces[row : row + children * count]
            blocks.append(("quad" if degree == QUAD else "triangle", np.asarray(own)))
            parents.append(np.repeat(np.arange(count), children))
            row += children * count
        elif kind == LINE:
            ours = (refined.line_parents >= line) & (refined.line_parents < line + count)
            blocks.append((LINE, refined.lines[ours]))
            parents.append(refined.line_parents[ours] - line)
            line += count
        else:
            blocks.append((kind, np.asarray(block.data)))
            parents.append(np.arange(count))

    def values_of(name: str, number: int) -> np.ndarray:
        if given.cells[number].type in FACES:
            return refined.cells[name][begins[number] : begins[number] + len(blocks[number][1])]
        return np.asarray(given.cell_data[name][number])[parents[number]]

    return type(given)(
        refined.vertices[:, : given.points.shape[1]],
        blocks,
        point_data=dict(refined.points),
        cell_data={
            name: [values_of(name, number) for number in range(len(blocks))]
            for name in given.cell_data
        },
        field_data=given.field_data,
        # Points keep their numbers.
        point_sets=given.point_sets,
        cell_sets={
            name: [_descendants(cells, of) for cells, of in zip(own, parents, strict=True)]
            for name, own in given.cell_sets.items()
        },
        gmsh_periodic=given.gmsh_periodic,
        info=given.info,
    )


def _descendants(cells: Any, parents: np.ndarray) -> np.ndarray:
    """Return the refined cells of some cells of a block, of which readers may give None."""
    old = np.asarray([] if cells is None else cells, dtype=np.int64)
    # In the order of the set.
    starts = np.searchsorted(parents, old)
    return ranges(starts, np.searchsorted(parents, old, "right") - starts)
