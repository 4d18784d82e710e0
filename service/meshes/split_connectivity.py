"""Refine a connectivity for attributes that blend linearly: one vertex a distinct corner.

A primitive's distinct corners (position and all attributes) form triangles of their own, cut open
at seams. Splitting them needs only where each new vertex lies: at a corner, on an edge, in a face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.fused.face_edges import number_edges

from .barycentric_grid import BarycentricGrid


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

    @property
    def refined_faces(self) -> Int[np.ndarray, "D 3"]:
        """(F · 4^L, 3) the refined faces, in the operator's order."""
        return at_descendants(self.ids, self.grid)

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Blend values at the refined vertices linearly, along edges and over faces."""
        corners, width = values.astype(np.float64), values.shape[1]
        weights = self.grid.points[self.grid.inner] / self.grid.segments
        along = np.empty((len(self.edges), self.grid.segments - 1, width))
        inner = np.empty((len(self.faces), len(weights), width))
        # One point of all edges, of all faces, after the other: numpy is slow along short rows.
        start, end = (np.take(corners, self.edges[:, side], axis=0) for side in (0, 1))
        for place, t in enumerate(self._edge_parameter):
            along[:, place] = (1 - t) * start + t * end
        of_face = [np.take(corners, self.faces[:, k], axis=0) for k in range(3)]
        for place, shares in enumerate(weights):
            inner[:, place] = sum(map(np.multiply, shares, of_face))
        return np.concatenate([part.reshape(-1, width) for part in (corners, along, inner)])

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Copy values at the refined vertices from the nearest corner (a tie: the first)."""
        side = (self._edge_parameter > 1 / 2).astype(np.int64)
        corner = self.grid.points[self.grid.inner].argmax(axis=1)
        parts = [values, values[self.edges[:, side]], values[self.faces[:, corner]]]
        return np.concatenate([part.reshape(-1, values.shape[1]) for part in parts])

    def at_vertices(self, at_points: Int[np.ndarray, "F T"]) -> Int[np.ndarray, " N"]:
        """Move labels that agree wherever refined vertices do from grid points to vertices."""
        labels = np.empty(self.count, dtype=np.int64)
        labels[self.ids] = at_points
        return labels

    @property
    def _edge_parameter(self) -> Float[np.ndarray, " n"]:
        """Where the n − 1 vertices of an edge lie between its lower and its higher corner."""
        return np.arange(1, self.grid.segments) / self.grid.segments


def at_descendants(ids: Int[np.ndarray, "F T"], grid: BarycentricGrid) -> Int[np.ndarray, "D 3"]:
    """Take values from grid points to the corners of all descendants, face by face."""
    # np.take, unlike indexing, gives rows that need no second copy to be reshaped.
    return np.take(ids, grid.faces.reshape(-1), axis=1).reshape(-1, 3)


def split_connectivity(
    faces: Int[np.ndarray, "F 3"], corner_count: int, grid: BarycentricGrid
) -> SplitConnectivity:
    """Split `faces` over `corner_count` distinct corners; no face names a corner twice."""
    edges, face_edges = number_edges(faces, corner_count)
    per_edge, per_face = grid.segments - 1, len(grid.inner)
    first_inner = corner_count + per_edge * len(edges)

    ids = np.empty((len(faces), len(grid.points)), dtype=np.int64)
    ids[:, :3] = faces
    step = np.arange(per_edge)
    for side in range(3):
        forward = faces[:, side] < faces[:, (side + 1) % 3]
        along = np.where(forward[:, None], step, per_edge - 1 - step)
        base = corner_count + per_edge * face_edges[:, side]
        ids[:, grid.sides[side]] = base[:, None] + along
    inner = first_inner + np.arange(len(faces) * per_face).reshape(len(faces), per_face)
    ids[:, grid.inner] = inner
    return SplitConnectivity(faces, edges, grid, ids, first_inner + inner.size)
