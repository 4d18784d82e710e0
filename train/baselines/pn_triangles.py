"""PN triangles: each edge bends into a cubic that meets both ends' tangent planes.

Source: Vlachos, Peters, Boyd, Mitchell 2001, Curved PN triangles. One step evaluates the cubic
triangle at its edges' midpoints; repeated steps estimate the normals anew. With normals split at an
angle, each face bends by normals of its own smooth side; along a split edge both sides share the
tangent of the crease.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pns_common import Scheme
from pns_common.kernels.connectivity import BOUNDARY, CREASE, INTERIOR
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.baselines.placement import edges_of, midpoints, placed_edges, vertex_normals
from train.connectivity import next_corner
from train.vectors import dot, unit

# Normals are one whose inner product is nearer to 1.
SAME = 1e-9


def pn_triangles(split: float | None = None) -> Scheme:
    """Return the scheme; normals are split at edges that turn by more than an angle, degrees.

    Old vertices stay; irregular edges take the midpoint.
    """

    def rule(level: Level) -> Additions:
        ends = edges_of(level)
        start, end = level.points[ends].transpose(1, 0, 2)
        whole = _paired(level)
        if split is None:
            normals = vertex_normals(level)[ends]
            near_start = cubic_control_point(start, end, normals[:, 0])
            near_end = cubic_control_point(end, start, normals[:, 1])
            whole |= level.topology.edge_class == BOUNDARY
        else:
            corners = _corner_normals(level, np.cos(np.radians(split)))
            near_start = _split_control_point(start, end, corners, level, ends[:, 0])
            near_end = _split_control_point(end, start, corners, level, ends[:, 1])
        # The cubic Bézier curve at ½. It depends on the edge alone: boundaries need no other rule.
        middle = (start + 3 * near_start + 3 * near_end + end) / 8
        edges = np.where(whole[:, None], middle, midpoints(level))
        return placed_edges(level, edges, level.points)

    return Scheme("pn-triangles", rule=rule, learned_levels=None)


def _paired(level: Level) -> Bool[np.ndarray, " E"]:
    """Return which edges lie between two faces, as creases do too."""
    return np.isin(level.topology.edge_class, (INTERIOR, CREASE))


def cubic_control_point(
    start: Float[np.ndarray, "N 3"], end: Float[np.ndarray, "N 3"], normal: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return b = (2 p1 + p2 − ((p2 − p1)·n1) n1) / 3: the third of the edge, onto the plane."""
    return (2 * start + end - dot(end - start, normal)[:, None] * normal) / 3


def _corner_normals(level: Level, least: float) -> Float[np.ndarray, "H 3"]:
    """Return at each corner the mean normal of the faces that smooth edges join it to.

    An edge is smooth where the normals of its faces have at least this inner product.
    """
    topology, count = level.topology, len(level.topology.corners)
    here, there = topology.half_edges[_paired(level)].T
    smooth = dot(level.normals[here // 3], level.normals[there // 3]) >= least
    here, there = here[smooth], there[smooth]
    ends = np.append(here, next_corner(here)), np.append(next_corner(there), there)
    joins = coo_array((np.ones(len(ends[0])), ends), shape=(count, count))
    group = connected_components(joins, directed=False)[1]
    a, b, c = level.points[topology.faces].transpose(1, 0, 2)
    summed = np.zeros((count, 3))
    np.add.at(summed, group, np.repeat(np.cross(b - a, c - a), 3, axis=0))
    return unit(summed)[group]


def _split_control_point(
    start: Float[np.ndarray, "E 3"],
    end: Float[np.ndarray, "E 3"],
    normals: Float[np.ndarray, "H 3"],
    level: Level,
    vertex: Int[np.ndarray, " E"],
) -> Float[np.ndarray, "E 3"]:
    """Return the third of each edge, onto the plane of its side, or the line of both sides."""
    corner = np.maximum(level.topology.half_edges, 0)
    own = level.topology.corners[corner] == vertex[:, None]
    first, second = normals[np.where(own, corner, next_corner(corner))].transpose(1, 0, 2)
    crease = unit(np.cross(first, second))
    along = start + dot(end - start, crease)[:, None] * crease / 3
    split = (dot(first, second) < 1 - SAME)[:, None]
    return np.where(split, along, cubic_control_point(start, end, first))
