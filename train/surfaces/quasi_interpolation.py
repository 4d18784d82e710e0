"""Loop on a control mesh that was pushed out first, by as much as its limit surface runs inside.

With e_v = p_v − (Loop's limit position of v) and m_v the unit normal of the faces at v, weighted by
area, Q1 pushes by e and N1 by (e · m) m.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import dot, norm
from pns_common.connectivity.topology import EdgeClass, sharp_edge_count
from pns_common.masks.stencils import (
    CURVE_LIMIT_CENTRE,
    CURVE_LIMIT_NEIGHBOUR,
    loop_beta,
    loop_edge_vertices,
    loop_vertex_vertices,
)
from pns_common.schemes import (
    ControlLevel,
    Placement,
    Scheme,
    loop_edge_rule,
    loop_vertex_rule,
)

Push = Callable[[ControlLevel], Float[np.ndarray, "V 3"]]


def q1() -> Scheme:
    """Return full quasi-interpolation at the first level, then Loop."""
    return _pushed("q1", lambda level: level.points - limit_positions(level))


def n1() -> Scheme:
    """Return quasi-interpolation along the normal at the first level, then Loop."""
    return _pushed("n1", normal_push)


def normal_push(level: ControlLevel) -> Float[np.ndarray, "V 3"]:
    """Return (e · m) m of every vertex."""
    normal = vertex_normals(level)
    return dot(level.points - limit_positions(level), normal)[:, None] * normal


def limit_positions(level: ControlLevel) -> Float[np.ndarray, "V 3"]:
    """Return Loop's limit position of every control vertex.

    Inside it is (1 − w) p + w (mean of the neighbours) with w = 8 k β / (8 k β + 3); on boundary
    and crease curves (1, 4, 1) / 6; corners and isolated vertices stay.
    """
    points, topology = level.points, level.topology
    valence = topology.valence
    pull = 8 * valence * loop_beta(valence)
    weight = pull / (pull + 3)
    sharp = sharp_edge_count(topology)
    mean = _neighbour_sum(points, topology.edges) / np.maximum(valence, 1)[:, None]
    inside = points + weight[:, None] * (mean - points)
    curves = topology.edges[topology.edge_class != EdgeClass.INTERIOR]
    on_curve = CURVE_LIMIT_CENTRE * points + CURVE_LIMIT_NEIGHBOUR * _neighbour_sum(points, curves)
    smooth, curve = ((sharp < 2) & (valence > 0))[:, None], (sharp == 2)[:, None]
    return np.where(smooth, inside, np.where(curve, on_curve, points))


def _neighbour_sum(points: Float[np.ndarray, "V 3"], edges: np.ndarray) -> Float[np.ndarray, "V 3"]:
    ends, others = edges.reshape(-1), edges[:, ::-1].reshape(-1)
    columns = [np.bincount(ends, column, len(points)) for column in points[others].T]
    return np.stack(columns, axis=1)


def _pushed(name: str, push_of: Push) -> Scheme:
    """Return Loop on a control mesh whose vertices were pushed once."""

    def vertex_rule(level: ControlLevel) -> Placement:
        share = loop_vertex_vertices(push_of(level), level.topology)
        return added_to(loop_vertex_rule(level), share)

    def edge_rule(level: ControlLevel) -> Placement:
        share = loop_edge_vertices(push_of(level), level.topology)
        return added_to(loop_edge_rule(level), share)

    return Scheme(name, vertex_rule, edge_rule, learned_levels=1)


def vertex_normals(level: ControlLevel) -> Float[np.ndarray, "V 3"]:
    """Return unit vertex normals, faces weighted by area; zero where there is none."""
    from_points = level.points[level.topology.faces]
    area = np.cross(from_points[:, 1] - from_points[:, 0], from_points[:, 2] - from_points[:, 0])
    summed = np.zeros_like(level.points)
    for corner in range(3):
        np.add.at(summed, level.topology.faces[:, corner], area)
    length = norm(summed)[:, None]
    return summed / np.where(length > 0, length, 1)


def added_to(base: Placement, displacement: Float[np.ndarray, "N 3"]) -> Placement:
    """Return a placement with a displacement that no gate or envelope is known of."""
    return Placement(base.loop, displacement, base.ratio, base.gate, base.degenerate)
