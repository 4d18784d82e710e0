"""Split a connectivity whose vertices are distinct corners, for attributes that blend linearly.

Distinct corners (position and all attributes) form triangles that are cut open at seams. Each new
vertex lies at a corner, on an edge or in a face.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.grid import (
    blend_along,
    blend_inside,
    move_to_vertices,
    number_points,
    take_points,
)
from pns_common.mesh.topology import build_topology
from pns_common.parallel import Blocks, available_threads

from .barycentric_grid import BarycentricGrid

BLOCK_POINTS = 2**17


@dataclass(frozen=True, eq=False)
class SplitConnectivity:
    """A refined connectivity. Its vertices: the C corners, then those on edges, then inner ones.

    Attributes:
        faces: (F, 3) corners before.
        edges: (E, 2) their edges, lower corner first.
        grid: the split.
        ids: (F, T) refined vertex at each grid point of each face.
        count: number of refined vertices.
    """

    faces: Int[np.ndarray, "F 3"]
    edges: Int[np.ndarray, "E 2"]
    grid: BarycentricGrid
    ids: Int[np.ndarray, "F T"]
    count: int

    @cached_property
    def refined_faces(self) -> Int[np.ndarray, "D 3"]:
        """(F · 4^L, 3) refined faces, in the order of the operator."""
        columns = self.grid.faces.reshape(-1)
        return take_points(self.ids, columns, self.ids.dtype, blocks_of(self.grid)).reshape(-1, 3)

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Return values at the refined vertices, blended along edges and over faces."""
        blended = np.empty((self.count, values.shape[1]))
        corners = blended[: len(values)]
        corners[:] = values
        first_inner = self.count - len(self.grid.inner) * len(self.faces)
        along, inside = blended[len(corners) : first_inner], blended[first_inner:]
        weights = self.grid.points[self.grid.inner] / self.grid.segments
        blocks = blocks_of(self.grid)
        blend_along(corners, self.edges, self._edge_parameters, along, blocks)
        blend_inside(corners, self.faces, weights, inside, blocks)
        return blended

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values at the refined vertices, of the nearest corner (in a tie, the first)."""
        side = (self._edge_parameters > 1 / 2).astype(np.int64)
        corner = self.grid.points[self.grid.inner].argmax(axis=1)
        parts = [values, values[self.edges[:, side]], values[self.faces[:, corner]]]
        return np.concatenate([part.reshape(-1, values.shape[1]) for part in parts])

    def at_vertices(self, at_points: Int[np.ndarray, "F T"]) -> Int[np.ndarray, " N"]:
        """Return labels of the refined vertices from labels at the grid points, which agree."""
        return move_to_vertices(self.ids, at_points, self.count, blocks_of(self.grid))

    @property
    def _edge_parameters(self) -> Float[np.ndarray, " n"]:
        """Positions of the n − 1 vertices of an edge, from 0 at its lower corner to 1."""
        return np.arange(1, self.grid.segments) / self.grid.segments


def blocks_of(grid: BarycentricGrid) -> Blocks:
    """Return blocks of faces whose grid points stay in a cache."""
    return Blocks(available_threads(), rows=max(BLOCK_POINTS // len(grid.points), 1))


def split_connectivity(
    faces: Int[np.ndarray, "F 3"], corner_count: int, grid: BarycentricGrid
) -> SplitConnectivity:
    """Split faces over distinct corners; no face has a corner twice."""
    topology = build_topology(faces, corner_count)
    per_edge, per_face = grid.segments - 1, len(grid.inner)
    first_inner = corner_count + per_edge * len(topology.edges)
    on_edges = corner_count + per_edge * topology.face_edges.astype(np.int64)
    ids = number_points(faces, on_edges, first_inner, grid.owner, grid.place, blocks_of(grid))
    count = first_inner + per_face * len(faces)
    return SplitConnectivity(faces, topology.edges, grid, ids, count)
