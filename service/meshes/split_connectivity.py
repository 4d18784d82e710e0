"""Refine a connectivity for attributes that blend linearly: one vertex a distinct corner.

A primitive's distinct corners (position and all attributes) form triangles of their own, cut open
at seams. Splitting them needs only where each new vertex lies: at a corner, on an edge, in a face.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.blocks import Blocks, available_threads
from pns_common.fused.face_edges import number_edges

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
        corners, width = values.astype(np.float64), values.shape[1]
        weights = self.grid.points[self.grid.inner] / self.grid.segments
        blended = np.empty((self.count, width))
        blended[: len(corners)] = corners
        on_edges = (len(self.edges), self.grid.segments - 1)
        first_inner = len(corners) + math.prod(on_edges)
        along = blended[len(corners) : first_inner].reshape(*on_edges, width)
        inner = blended[first_inner:].reshape(len(self.faces), len(weights), width)
        # One point of all edges, of all faces, after the other: numpy is slow along short rows.
        start, end = (np.take(corners, self.edges[:, side], axis=0) for side in (0, 1))
        for place, t in enumerate(self._edge_parameter):
            along[:, place] = (1 - t) * start + t * end
        of_face = [np.take(corners, self.faces[:, k], axis=0) for k in range(3)]
        for place, shares in enumerate(weights):
            inner[:, place] = sum(map(np.multiply, shares, of_face))
        return blended

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Copy values at the refined vertices from the nearest corner (a tie: the first)."""
        side = (self._edge_parameter > 1 / 2).astype(np.int64)
        corner = self.grid.points[self.grid.inner].argmax(axis=1)
        parts = [values, values[self.edges[:, side]], values[self.faces[:, corner]]]
        return np.concatenate([part.reshape(-1, values.shape[1]) for part in parts])

    def at_vertices(self, at_points: Int[np.ndarray, "F T"]) -> Int[np.ndarray, " N"]:
        """Move labels that agree wherever refined vertices do from grid points to vertices."""
        labels = np.empty(self.count, dtype=np.int64)

        def move(rows: slice) -> None:
            labels[self.ids[rows]] = at_points[rows]

        blocks_of(self.grid).run(len(at_points), move)
        return labels

    @property
    def _edge_parameter(self) -> Float[np.ndarray, " n"]:
        """Where the n − 1 vertices of an edge lie between its lower and its higher corner."""
        return np.arange(1, self.grid.segments) / self.grid.segments


def at_descendants(ids: Int[np.ndarray, "F T"], grid: BarycentricGrid) -> Int[np.ndarray, "D 3"]:
    """Take vertices from grid points to the corners of all descendants, face by face."""
    points = grid.faces.reshape(-1)
    corners = np.empty((len(ids), len(points)), dtype=ids.dtype)

    def take(rows: slice) -> None:
        # All points are in range; where numpy has to look, it makes a copy first.
        np.take(ids[rows], points, axis=1, out=corners[rows], mode="clip")

    blocks_of(grid).run(len(ids), take)
    return corners.reshape(-1, 3)


def blocks_of(grid: BarycentricGrid) -> Blocks:
    """Return how rows of grid points are divided: what is made of a block stays in a cache."""
    return Blocks(available_threads(), max(BLOCK_POINTS // len(grid.points), 1))


def index_type(count: int) -> type[np.int32] | type[np.int64]:
    """Return the narrowest type of indices below `count`: half the memory is half the time."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


def split_connectivity(
    faces: Int[np.ndarray, "F 3"], corner_count: int, grid: BarycentricGrid
) -> SplitConnectivity:
    """Split `faces` over `corner_count` distinct corners; no face names a corner twice."""
    edges, face_edges = number_edges(faces, corner_count)
    per_edge, per_face = grid.segments - 1, len(grid.inner)
    first_inner = corner_count + per_edge * len(edges)
    count = first_inner + per_face * len(faces)
    ids = np.empty((len(faces), len(grid.points)), dtype=index_type(count))

    def number(rows: slice) -> None:
        in_face = first_inner + per_face * np.arange(rows.start, rows.stop)
        on_edge = corner_count + per_edge * face_edges[rows]
        first_of_owner = np.concatenate([faces[rows], on_edge, in_face[:, None]], axis=1)
        a, b, c = faces[rows].T
        backwards = 1 * (a > b) + 2 * (b > c) + 4 * (c > a)
        place = np.take(grid.place, backwards, axis=0)
        ids[rows] = np.take(first_of_owner, grid.owner, axis=1) + place

    blocks_of(grid).run(len(faces), number)
    return SplitConnectivity(faces, edges, grid, ids, count)
