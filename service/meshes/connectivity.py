"""Edges of triangles, and fans of corners that can share a normal."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology

from .kernels import join_corners


def next_corner(corners: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return the corner after each corner 3 f + i of its triangle."""
    return np.where(corners % 3 < 2, corners + 1, corners - 2)


def number_edges(
    faces: Int[np.ndarray, "F 3"], vertex_count: int
) -> tuple[Int[np.ndarray, "E 2"], Int[np.ndarray, "F 3"]]:
    """Return the edges, lower vertex first, and the edges of each face."""
    topology = build_topology(faces, vertex_count)
    return topology.edges, topology.face_edges


def interior_edges(
    faces: Int[np.ndarray, "F 3"], vertex_count: int
) -> tuple[Int[np.ndarray, "I 2"], Int[np.ndarray, "I 2"]]:
    """Return the interior edges and the two half-edges (corners) of each."""
    topology = build_topology(faces, vertex_count)
    return topology.edges[topology.interior], topology.half_edges[topology.interior]


def smooth_fans(
    faces: Int[np.ndarray, "F 3"], vertex_count: int, creases: Int[np.ndarray, "N 2"] | None
) -> Int[np.ndarray, "F 3"]:
    """Return the fan of each corner, numbered by first appearance.

    The corners of a fan belong to faces around a vertex that follow each other across interior
    edges. Creases, boundaries and irregular edges separate fans.
    """
    topology = with_creases(build_topology(faces, vertex_count), creases)
    fans = np.empty(faces.size, dtype=np.int64)
    join_corners(topology.half_edges[topology.interior], fans)
    return fans.reshape(-1, 3)
