"""The crease lines of a level, as ``pns_common.geometry.crease_lines`` finds them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import Creases
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.edge_rows import mark_alone
from pns_common.fused.kernels.going_on import drop_loose_ends
from pns_common.fused.kernels.sides import mark_between_sides
from pns_common.fused.kernels.turns import mark_edges_beyond
from pns_common.fused.levels.mesh_edges import MeshEdges
from pns_common.geometry.crease_lines import is_edged
from pns_common.geometry.crease_lines.edge_rows import PARALLEL, ROW_ANGLE
from pns_common.geometry.crease_lines.going_on import may_end
from pns_common.geometry.crease_lines.turns import cosine_of


def crease_line_rows(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    creases: Creases,
    blocks: Blocks,
) -> Int[np.ndarray, " N"]:
    """Return the edges of the lines to look for; ``normals`` are the faces'."""
    assert creases.line_angle is not None
    cosine, known = cosine_of(creases.line_angle), creases.edged
    beyond, found = edges_beyond(mesh, normals, cosine, blocks)
    sharp, alone = np.flatnonzero(beyond).astype(np.int32), np.ones(found, dtype=bool)
    # Without an edge beyond θ no mesh is edged.
    if creases.edged_angle is not None and (found if known is None else known):
        bent, _ = edges_beyond(mesh, normals, cosine_of(creases.edged_angle), blocks)
        rows = np.flatnonzero(bent).astype(np.int32)
        bent_alone = edges_alone(points, mesh, normals, rows, blocks)
        if known or is_edged(found, int(np.count_nonzero(bent_alone))):
            beyond, sharp, alone = bent, rows, bent_alone
    if not len(sharp):
        return sharp
    is_between = np.empty(len(sharp), dtype=bool)
    turning = normals, mesh.face_edges, mesh.half_edges, mesh.edge_class, beyond
    blocks.run(len(sharp), mark_between_sides.over(*turning, sharp, ROWS, is_between))
    between, at_rim = sharp[is_between & alone], may_end(mesh, normals)
    left = np.ones(len(between), dtype=bool)
    met = np.zeros(mesh.vertex_count, dtype=np.int32), np.zeros((mesh.vertex_count, 3))
    drop_loose_ends(points, mesh.edges, between, at_rim, cosine, *met, left)
    return between[left]


def edges_alone(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    normals: Float[np.ndarray, "F 3"],
    rows: Int[np.ndarray, " N"],
    blocks: Blocks,
) -> Bool[np.ndarray, " N"]:
    """Return which interior edges turn far or are in no row."""
    alone = np.empty(len(rows), dtype=bool)
    around = mesh.faces, mesh.edges, mesh.face_edges, mesh.half_edges, mesh.edge_class
    least = PARALLEL**2, cosine_of(ROW_ANGLE)
    blocks.run(len(rows), mark_alone.over(points, normals, *around, *least, rows, ROWS, alone))
    return alone


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
