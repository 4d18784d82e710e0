"""The crease lines of a level, as ``pns_common.geometry.crease_lines`` finds them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.fused.kernels.compiled import ROWS, Kernel
from pns_common.fused.kernels.edge_rows import mark_alone
from pns_common.fused.kernels.going_on import drop_loose_ends
from pns_common.fused.kernels.plane_sides import mark_beside_level_faces
from pns_common.fused.kernels.sides import mark_between_sides
from pns_common.fused.kernels.turns import mark_edges_beyond
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.geometry.crease_lines import is_edged
from pns_common.geometry.crease_lines.edge_rows import PARALLEL, ROW_ANGLE
from pns_common.geometry.crease_lines.going_on import may_end
from pns_common.geometry.crease_lines.plane_sides import beside_planes
from pns_common.geometry.crease_lines.turns import IN_ONE_PLANE, cosine_of


def crease_line_rows(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    creases: Creases,
    blocks: Blocks,
) -> Int[np.ndarray, " N"]:
    """Return the edges of the lines to look for; ``normals`` are the faces'."""
    assert creases.line_angle is not None
    cosine = cosine_of(creases.line_angle)
    if creases.edged_angle is None:
        sharp, _ = edges_beyond(mesh, normals, cosine, blocks)
        rows = sharp_between_sides(mesh, normals, sharp, blocks)
    else:
        gentle = cosine_of(creases.edged_angle)
        rows = with_gentler(points, mesh, normals, (cosine, gentle), creases.edged, blocks)
    left = np.ones(len(rows), dtype=bool)
    if len(rows):
        met = np.zeros(mesh.vertex_count, dtype=np.int32), np.zeros((mesh.vertex_count, 3))
        at_rim = may_end(mesh, normals)
        drop_loose_ends(points, mesh.edges, rows, at_rim, cosine, *met, left)
    return rows[left]


def with_gentler(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    cosines: tuple[float, float],
    known: bool | None,
    blocks: Blocks,
) -> Int[np.ndarray, " N"]:
    """Return the edges with all marks but the third, of θ and θ'; ``known``: if it is edged."""
    cosine, gentle = cosines
    bent, more = edges_beyond(mesh, normals, gentle, blocks)
    rows = np.flatnonzero(bent).astype(np.int32)
    if not more:
        return rows  # as of most fine meshes
    sharp, found = edges_beyond(mesh, normals, cosine, blocks)
    rows = rows[edges_alone(points, mesh, normals, rows, blocks)]
    if is_edged(found, len(rows)) if known is None else known:
        return rows[between_sides(mesh, normals, rows, bent, blocks)]
    rows = rows[beside_level_faces(mesh, normals, rows, blocks)]
    rows = rows[beside_planes(normals, mesh, rows)]
    rows = rows[between_sides(mesh, normals, rows, bent, blocks)]
    return np.union1d(sharp_between_sides(mesh, normals, sharp, blocks), rows)


def sharp_between_sides(
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    sharp: Bool[np.ndarray, " E"],
    blocks: Blocks,
) -> Int[np.ndarray, " N"]:
    """Return those of all sharp edges at which two sides of a part meet."""
    rows = np.flatnonzero(sharp).astype(np.int32)
    return rows[between_sides(mesh, normals, rows, sharp, blocks)]


def between_sides(
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    rows: Int[np.ndarray, " N"],
    sharp: Bool[np.ndarray, " E"],
    blocks: Blocks,
) -> Bool[np.ndarray, " N"]:
    """Return at which of some of the sharp edges two sides of a part meet."""
    around = normals, mesh.face_edges, mesh.half_edges, mesh.edge_class, sharp
    return _marked(mark_between_sides, around, rows, blocks)


def beside_level_faces(
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    rows: Int[np.ndarray, " N"],
    blocks: Blocks,
) -> Bool[np.ndarray, " N"]:
    """Return which interior edges may lie beside a plane side, as few do: the others do not."""
    around = normals, mesh.face_edges, mesh.half_edges, mesh.edge_class, cosine_of(IN_ONE_PLANE)
    return _marked(mark_beside_level_faces, around, rows, blocks)


def edges_alone(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    rows: Int[np.ndarray, " N"],
    blocks: Blocks,
) -> Bool[np.ndarray, " N"]:
    """Return which interior edges turn far or are in no row."""
    around = mesh.faces, mesh.edges, mesh.face_edges, mesh.half_edges, mesh.edge_class
    least = PARALLEL**2, cosine_of(ROW_ANGLE)
    return _marked(mark_alone, (points, normals, *around, *least), rows, blocks)


def _marked(
    mark: Kernel,
    around: tuple[np.ndarray | float, ...],
    rows: Int[np.ndarray, " N"],
    blocks: Blocks,
) -> Bool[np.ndarray, " N"]:
    """Return which edges a kernel marks, of what it reads around them."""
    marks = np.empty(len(rows), dtype=bool)
    blocks.run(len(rows), mark.over(*around, rows, ROWS, marks))
    return marks


def edges_beyond(
    mesh: MeshEdges, normals: Float[np.ndarray, "F 3"], cosine: float, blocks: Blocks
) -> tuple[Bool[np.ndarray, " E"], int]:
    """Return which interior edges' normals have a smaller cosine, and how many."""
    count = len(mesh.edges)
    beyond, found = np.empty(count, dtype=bool), np.zeros(blocks.count(count), dtype=np.int64)
    around = normals, mesh.half_edges, mesh.edge_class, cosine
    mark_beyond = mark_edges_beyond.over(*around, ROWS, beyond)

    def mark(rows: slice) -> None:
        found[blocks.number(rows, count)] = mark_beyond(rows)

    blocks.run(count, mark)
    return beyond, int(found.sum())
