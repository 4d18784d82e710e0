"""Refine a connectivity for attributes that blend linearly: one vertex a distinct corner.

A primitive's distinct corners (position and all attributes) form triangles of their own, cut open
at seams. Splitting them needs only where each new vertex lies: at a corner, on an edge, in a face.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.blocks import Blocks, available_threads
from pns_common.fused.where_loaded.face_edges import number_edges
from pns_common.fused.where_loaded.grid_points import (
    blend_along,
    blend_inside,
    move_to_vertices,
    number_points,
    take_points,
)

from .barycentric_grid import BarycentricGrid

BLOCK_POINTS = 2**17


@dataclass(frozen=True, eq=False)
class SplitConnectivity:
    """A refined connectivity. Its vertices: the C corners, then those on edges, then inner ones.

    Attributes:
        faces: (F, 3) corners before.
        edges: (E, 2) their edges, lower corner first.
        grid: the split.
        ids: (F, T) the refined vertex at each grid point of each face.
        count: the number of refined vertices.
    """

    faces: Int[np.ndarray, "F 3"]
    edges: Int[np.ndarray, "E 2"]
    grid: BarycentricGrid
    ids: Int[np.ndarray, "F T"]
    count: int

    @cached_property
    def refined_faces(self) -> Int[np.ndarray, "D 3"]:
        """(F · 4^L, 3) the refined faces, in the operator's order."""
        return at_descendants(self.ids, self.grid)

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Blend values at the refined vertices linearly, along edges and over faces."""
        blended = np.empty((self.count, values.shape[1]))
        corners = blended[: len(values)]
        corners[:] = values
        first_inner = self.count - len(self.grid.inner) * len(self.faces)
        along, inside = blended[len(corners) : first_inner], blended[first_inner:]
        weights = self.grid.points[self.grid.inner] / self.grid.segments
        blocks = blocks_of(self.grid)
        blend_along(corners, self.edges, self._edge_parameter, along, blocks)
        blend_inside(corners, self.faces, weights, inside, blocks)
        return blended

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Copy values at the refined vertices from the nearest corner (a tie: the first)."""
        side = (self._edge_parameter > 1 / 2).astype(np.int64)
        corner = self.grid.points[self.grid.inner].argmax(axis=1)
        parts = [values, values[self.edges[:, side]], values[self.faces[:, corner]]]
        return np.concatenate([part.reshape(-1, values.shape[1]) for part in parts])

    def at_vertices(self, at_points: Int[np.ndarray, "F T"]) -> Int[np.ndarray, " N"]:
        """Move labels that agree wherever refined vertices do from grid points to vertices."""
        return move_to_vertices(self.ids, at_points, self.count, blocks_of(self.grid))

    @property
    def _edge_parameter(self) -> Float[np.ndarray, " n"]:
        """Where the n − 1 vertices of an edge lie between its lower and its higher corner."""
        return np.arange(1, self.grid.segments) / self.grid.segments


def at_descendants(ids: Int[np.ndarray, "F T"], grid: BarycentricGrid) -> Int[np.ndarray, "D 3"]:
    """Take vertices from grid points to the corners of all descendants, face by face."""
    return take_points(ids, grid.faces.reshape(-1), ids.dtype, blocks_of(grid)).reshape(-1, 3)


def blocks_of(grid: BarycentricGrid) -> Blocks:
    """Return how rows of grid points are divided: what is made of a block stays in a cache."""
    return Blocks(available_threads(), max(BLOCK_POINTS // len(grid.points), 1))


def split_connectivity(
    faces: Int[np.ndarray, "F 3"], corner_count: int, grid: BarycentricGrid
) -> SplitConnectivity:
    """Split `faces` over `corner_count` distinct corners; no face names a corner twice."""
    edges, face_edges = number_edges(faces, corner_count)
    per_edge, per_face = grid.segments - 1, len(grid.inner)
    first_inner = corner_count + per_edge * len(edges)
    on_edges = corner_count + per_edge * face_edges
    ids = number_points(faces, on_edges, first_inner, grid.owner, grid.place, blocks_of(grid))
    return SplitConnectivity(faces, edges, grid, ids, first_inner + per_face * len(faces))
