"""Where Loop puts a level's vertices, with the bits of ``pns_common.masks.stencils``."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.fused.freed_memory import make_room
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.masks import (
    add_displacement,
    blend_vertices,
    largest_coordinate,
    place_edges,
    sum_along_curves,
    sum_rings,
)
from pns_common.fused.levels.loop_weights import weights_of
from pns_common.fused.levels.mesh_edges import MeshEdges


def loop_points(
    points: Float[np.ndarray, "V 3"], mesh: MeshEdges, blocks: Blocks
) -> Float[np.ndarray, "W 3"]:
    """Place old vertices, then edge vertices, where Loop puts them."""
    count, edge_count = mesh.vertex_count, len(mesh.edges)
    placed = np.empty((count + edge_count, 3))
    make_room(placed.nbytes)
    args = points, mesh.faces, mesh.edges, mesh.half_edges, mesh.edge_class
    blocks.run(edge_count, place_edges.over(*args, ROWS, placed[count:]))
    place_vertices(points, mesh, blocks, placed[:count])
    return placed


def owners(blocks: Blocks, count: int) -> Blocks:
    """Return blocks for sums around vertices.

    Each reads all edges, so there are no more of them than threads.
    """
    some = max(1, min(blocks.threads, count // (blocks.least or blocks.rows)))
    return blocks.of_rows(max(1, -(-count // some)))


def largest_size(points: Float[np.ndarray, "V 3"], blocks: Blocks) -> float:
    """Return the largest absolute coordinate; NaN where one is."""
    sizes, largest = np.zeros(blocks.count(len(points))), largest_coordinate.over(points, ROWS)

    def measure(rows: slice) -> None:
        sizes[blocks.number(rows, len(points))] = largest(rows)

    blocks.run(len(points), measure)
    return float(sizes.max(initial=0))


def add_to(
    points: Float[np.ndarray, "W 3"],
    displacement: Float[np.ndarray, "W 3"],
    first: int,
    blocks: Blocks,
) -> tuple[float, float]:
    """Add to points from ``first`` on, in their place.

    Returns ``largest_size`` of them all, and the largest length of what was added.
    """
    count = blocks.count(len(points))
    sizes, squares = np.zeros(count), np.zeros((count, 1))
    add_rows = add_displacement.over(displacement, first, ROWS, points)

    def add(rows: slice) -> None:
        block = blocks.number(rows, len(points))
        sizes[block] = add_rows(rows, squares[block])

    blocks.run(len(points), add)
    return float(sizes.max(initial=0)), math.sqrt(squares.max(initial=0))


def place_vertices(
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    blocks: Blocks,
    placed: Float[np.ndarray, "V 3"],
) -> None:
    """Write Loop's old vertices into ``placed``."""
    count = mesh.vertex_count
    valence = np.empty(count, dtype=np.int32)
    sharp, sharp_edges = mesh.sharp, mesh.sharp_edges
    add_up = sum_rings.over(points, mesh.edges, mesh.edge_reach, ROWS, placed, valence)
    along = sum_along_curves.over(points, mesh.edges, sharp_edges, sharp, ROWS, placed)

    def rings(rows: slice) -> None:
        add_up(rows)
        if len(sharp):
            along(rows)

    owners(blocks, count).run(count, rings)
    beta = weights_of(valence).beta
    blocks.run(count, blend_vertices.over(points, valence, sharp, beta, ROWS, placed))
