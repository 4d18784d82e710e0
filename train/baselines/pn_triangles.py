"""PN triangles: each edge bends into a cubic that meets both ends' tangent planes.

Source: Vlachos, Peters, Boyd, Mitchell 2001, Curved PN triangles. One step evaluates the cubic
triangle at its edges' midpoints; repeated steps estimate the normals anew.
"""

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import dot
from pns_common.connectivity.topology import EdgeClass
from pns_common.schemes import ControlLevel, Placement, Scheme
from train.baselines.placement import kept_vertices, midpoints, placed_edges
from train.surfaces.quasi_interpolation import vertex_normals


def pn_triangles() -> Scheme:
    """Return the scheme. Old vertices stay; irregular edges take the midpoint."""
    return Scheme("pn-triangles", kept_vertices, _edge_rule)


def cubic_control_point(
    start: Float[np.ndarray, "N 3"],
    end: Float[np.ndarray, "N 3"],
    normal: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 3"]:
    """Return b = (2 p1 + p2 − ((p2 − p1)·n1) n1) / 3: the third of the edge, onto the plane."""
    return (2 * start + end - dot(end - start, normal)[:, None] * normal) / 3


def _edge_rule(level: ControlLevel) -> Placement:
    normals = vertex_normals(level)
    a, b = level.topology.edges.T
    start, end = level.points[a], level.points[b]
    near_start = cubic_control_point(start, end, normals[a])
    near_end = cubic_control_point(end, start, normals[b])
    # The cubic Bézier curve at ½. It depends on the edge alone, so boundaries need no other rule.
    middle = (start + 3 * near_start + 3 * near_end + end) / 8
    irregular = (level.topology.edge_class == EdgeClass.IRREGULAR)[:, None]
    return placed_edges(level, np.where(irregular, midpoints(level), middle))
