"""Faces of a mesh that pass through another face, away from what the two share."""

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.arrays import cross, dot
from pns_common.mesh import Mesh

CELL = 1.5
"""Side of a cell, in mean side lengths of the faces' boxes."""

MOST_CELLS = 1 << 20
"""Cells along one side of the grid, at most: three of them fit into an int64 key."""

SLACK = 1e-12
"""Crossings this close to a border, as a share of a triangle, are no crossings."""

Pairs = Int[np.ndarray, "N 2"]
Corners = Float[np.ndarray, "N 3 3"]


def self_intersecting(mesh: Mesh) -> Bool[np.ndarray, " F"]:
    """Return which faces an edge of another face passes through, or the reverse.

    Faces that share an edge are not looked at, nor are faces in one plane. Of faces that share a
    vertex only the edges opposite it are: the others meet the other face's plane there already, and
    where the two are almost in one plane rounding would decide.
    """
    corners = mesh.vertices[mesh.faces]
    pairs = _near_pairs(corners)
    pairs = pairs[~_share_an_edge(mesh.faces, pairs)]
    met = _crosses(mesh, pairs)
    crossing = np.zeros(len(mesh.faces), dtype=bool)
    crossing[pairs[met].reshape(-1)] = True
    return crossing


def _near_pairs(corners: Corners) -> Pairs:
    """Return all pairs of faces whose boxes overlap, each once."""
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    side = max(CELL * float((upper - lower).mean()), float(np.ptp(upper)) / MOST_CELLS, 1e-300)
    origin = lower.min(axis=0)
    first = np.floor((lower - origin) / side).astype(np.int64)
    span = np.floor((upper - origin) / side).astype(np.int64) - first + 1
    copies = span.prod(axis=1)
    face = np.repeat(np.arange(len(corners)), copies)
    place = np.arange(len(face)) - np.repeat(np.cumsum(copies) - copies, copies)
    rows = span[face]
    steps = np.stack(
        [place % rows[:, 0], place // rows[:, 0] % rows[:, 1], place // (rows[:, 0] * rows[:, 1])],
        axis=1,
    )
    cell = first[face] + steps
    key = (cell[:, 0] * MOST_CELLS + cell[:, 1]) * MOST_CELLS + cell[:, 2]
    order = np.argsort(key, kind="stable")
    key, face, cell = key[order], face[order], cell[order]
    # Each entry meets those after it in its own cell.
    end = np.searchsorted(key, key, side="right")
    partners = end - np.arange(len(key)) - 1
    entry = np.repeat(np.arange(len(key)), partners)
    later = entry + 1 + np.arange(len(entry)) - np.repeat(np.cumsum(partners) - partners, partners)
    a, b = face[entry], face[later]
    low = np.maximum(lower[a], lower[b])
    overlap = (low <= np.minimum(upper[a], upper[b])).all(axis=1)
    # A pair that shares several cells counts in the one that holds its boxes' common corner.
    here = np.floor((low - origin) / side).astype(np.int64) == cell[entry]
    kept = overlap & here.all(axis=1)
    return np.stack([a[kept], b[kept]], axis=1)


def _share_an_edge(faces: Int[np.ndarray, "F 3"], pairs: Pairs) -> Bool[np.ndarray, " N"]:
    first, second = faces[pairs[:, 0]], faces[pairs[:, 1]]
    return (first[:, :, None] == second[:, None, :]).sum(axis=(1, 2)) > 1


def _crosses(mesh: Mesh, pairs: Pairs) -> Bool[np.ndarray, " N"]:
    """Return whether an edge of either triangle passes through the other."""
    met = np.zeros(len(pairs), dtype=bool)
    for here, there in ((0, 1), (1, 0)):
        face, edges = mesh.faces[pairs[:, here]], mesh.faces[pairs[:, there]]
        triangle, ends = mesh.vertices[face], mesh.vertices[edges]
        shared = (edges[:, :, None] == face[:, None, :]).any(axis=2)
        for corner in range(3):
            after = (corner + 1) % 3
            apart = ~shared[:, corner] & ~shared[:, after]
            met[apart] |= _pierces(ends[apart, corner], ends[apart, after], triangle[apart])
    return met


def _pierces(
    start: Float[np.ndarray, "N 3"], end: Float[np.ndarray, "N 3"], triangle: Corners
) -> Bool[np.ndarray, " N"]:
    """Return whether segments pass through triangles (Möller and Trumbore 1997)."""
    a = triangle[:, 0]
    u, v, along = triangle[:, 1] - a, triangle[:, 2] - a, end - start
    side = cross(along, v)
    volume = dot(u, side)
    flat = np.abs(volume) <= SLACK * np.sqrt(dot(u, u) * dot(v, v) * dot(along, along))
    scale = 1 / np.where(flat, 1.0, volume)
    offset = start - a
    first = dot(offset, side) * scale
    lifted = cross(offset, u)
    second, reach = dot(along, lifted) * scale, dot(v, lifted) * scale
    inside = (first > SLACK) & (second > SLACK) & (first + second < 1 - SLACK)
    return ~flat & inside & (reach > SLACK) & (reach < 1 - SLACK)
