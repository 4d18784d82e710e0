"""Split a connectivity whose vertices are distinct corners, for attributes that blend linearly.

Distinct corners (position and all attributes) form triangles that are cut open at seams. Each new
vertex lies at a corner, on an edge or in a face.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Float32, Int, Shaped

from . import kernels
from .barycentric_grid import BarycentricGrid
from .connectivity import number_edges

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
        return take_points(self.ids, self.grid.faces.reshape(-1), self.ids.dtype).reshape(-1, 3)

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Return values at the refined vertices, blended along edges and over faces."""
        blended = np.empty((self.count, values.shape[1]))
        corners = blended[: len(values)]
        corners[:] = values
        first_inner = self.count - len(self.grid.inner) * len(self.faces)
        along, inside = blended[len(corners) : first_inner], blended[first_inner:]
        weights = self.grid.points[self.grid.inner] / self.grid.segments
        rows = block_rows(self.grid)
        given = corners, self.edges, self._edge_parameters, along
        kernels.in_blocks(len(self.edges), kernels.blend_along, *given, rows=rows)
        given = corners, self.faces, weights, inside
        kernels.in_blocks(len(self.faces), kernels.blend_inside, *given, rows=rows)
        return blended

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values at the refined vertices, of the nearest corner (in a tie, the first)."""
        side = (self._edge_parameters > 1 / 2).astype(np.int64)
        corner = self.grid.points[self.grid.inner].argmax(axis=1)
        parts = [values, values[self.edges[:, side]], values[self.faces[:, corner]]]
        return np.concatenate([part.reshape(-1, values.shape[1]) for part in parts])

    def at_vertices(self, at_points: Int[np.ndarray, "F T"]) -> Int[np.ndarray, " N"]:
        """Return labels of the refined vertices from labels at the grid points, which agree."""
        labels = np.empty(self.count, dtype=at_points.dtype)
        kernels.in_blocks(
            len(self.ids),
            kernels.move_to_vertices,
            self.ids,
            at_points,
            labels,
            rows=block_rows(self.grid),
        )
        return labels

    @property
    def _edge_parameters(self) -> Float[np.ndarray, " n"]:
        """Where the n − 1 vertices of an edge lie, from 0 at its lower corner to 1."""
        return np.arange(1, self.grid.segments) / self.grid.segments


def take_points(
    rows: Int[np.ndarray, "F K"], columns: Int[np.ndarray, " T"], dtype: np.dtype
) -> Int[np.ndarray, "F T"]:
    """Return columns of rows of vertices, in a type that can hold them."""
    taken = np.empty((len(rows), len(columns)), dtype=dtype)
    size = max(BLOCK_POINTS // len(columns), 1)
    kernels.in_blocks(len(rows), kernels.take_columns, rows, columns, taken, rows=size)
    return taken


def rounded_rows(
    values: Float[np.ndarray, "V K"], rows: Int[np.ndarray, " N"]
) -> Float32[np.ndarray, "N K"]:
    """Return rows of values in single precision."""
    rounded = np.empty((len(rows), values.shape[1]), dtype=np.float32)
    kernels.in_blocks(len(rows), kernels.round_rows, values, rows, rounded)
    return rounded


def block_rows(grid: BarycentricGrid) -> int:
    """Return the number of faces in a block of work, whose results stay in a cache."""
    return max(BLOCK_POINTS // len(grid.points), 1)


def split_connectivity(
    faces: Int[np.ndarray, "F 3"], corner_count: int, grid: BarycentricGrid
) -> SplitConnectivity:
    """Split faces over distinct corners; no face has a corner twice."""
    edges, face_edges = number_edges(faces, corner_count)
    per_edge, per_face = grid.segments - 1, len(grid.inner)
    first_inner = corner_count + per_edge * len(edges)
    count = first_inner + per_face * len(faces)
    ids = np.empty((len(faces), len(grid.points)), dtype=kernels.index_type(count))
    on_edges = corner_count + per_edge * face_edges
    given = faces, on_edges, first_inner, per_face, grid.owner, grid.place, ids
    kernels.in_blocks(len(faces), kernels.number_points, *given, rows=block_rows(grid))
    return SplitConnectivity(faces, edges, grid, ids, count)
