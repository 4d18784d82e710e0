"""Modified Butterfly subdivision: interpolating, C¹ also at extraordinary vertices.

Source: Zorin, Schröder, Sweldens 1996, Interpolating subdivision for meshes with arbitrary
topology. On the regular grid this is the eight-point butterfly of Dyn, Levin and Gregory 1990.
"""

import numpy as np
from jaxtyping import Float, Int

from pns_common import Scheme
from pns_common.kernels.connectivity import BOUNDARY
from pns_common.mesh.topology import Topology
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.baselines.placement import edges_of, midpoints, placed_edges
from train.connectivity import next_corner

REGULAR_VALENCE = 6
ENDPOINT, OPPOSITE, WING = 1 / 2, 1 / 8, -1 / 16
STAR_CENTRE = 3 / 4
CURVE_NEAR, CURVE_FAR = 9 / 16, -1 / 16


def modified_butterfly() -> Scheme:
    """Return the scheme. Old vertices stay; irregular edges take the midpoint."""
    return Scheme("butterfly", rule=_rule, learned_levels=None)


def _rule(level: Level) -> Additions:
    return placed_edges(level, butterfly_edge_vertices(level), level.points)


def butterfly_edge_vertices(level: Level) -> Float[np.ndarray, "E 3"]:
    """Return one vertex for each edge.

    An interior edge takes the star rule of its extraordinary end, the mean of both where both ends
    are, else the eight-point rule. What the eight-point stencil misses beyond a boundary is
    reflected across it, and a vertex on a boundary counts as regular, as in the source.
    """
    topology, placed = level.topology, midpoints(level)
    boundary = np.flatnonzero(topology.edge_class == BOUNDARY)
    placed[boundary] = _boundary_points(level, boundary)
    # One closed fan of a valence other than 6; a star needs three.
    extraordinary = level.ringed & (topology.valence >= 3) & (topology.valence != REGULAR_VALENCE)
    interior, twins = topology.interior, _twins(topology)
    star_sum, stars = np.zeros_like(placed), np.zeros(len(placed))
    # Of the two half-edges of an edge, each starts at another end.
    for half_edge in topology.half_edges[interior].T:
        rows = extraordinary[topology.corners[half_edge]]
        star_sum[interior[rows]] += _star_points(level, twins, half_edge[rows])
        stars[interior[rows]] += 1
    regular = interior[stars[interior] == 0]
    placed[regular] = _eight_points(level, twins, regular)
    of_stars = stars > 0
    placed[of_stars] = star_sum[of_stars] / stars[of_stars, None]
    return placed


def star_weights(
    valence: Int[np.ndarray, " N"], turn: int | Int[np.ndarray, " N"]
) -> Float[np.ndarray, " N"]:
    """Return s_j, the weight of neighbour j = `turn` of a star of valence K ≥ 3; j = 0 is the end.

    s_j = (1/4 + cos 2πj/K + 1/2 cos 4πj/K) / K for K ≥ 5; valences 3 and 4 have their own.
    """
    angle = 2 * np.pi * np.asarray(turn) / valence
    weights = (1 / 4 + np.cos(angle) + np.cos(2 * angle) / 2) / valence
    weights = np.where(valence == 4, np.array([3 / 8, 0, -1 / 8, 0])[turn % 4], weights)
    return np.where(valence == 3, np.array([5 / 12, -1 / 12, -1 / 12])[turn % 3], weights)


def _star_points(
    level: Level, twins: Int[np.ndarray, " H"], half_edge: Int[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    """Apply the star rule at the start of each half-edge, whose end is neighbour 0."""
    points, vertex = level.points, level.topology.corners
    centre = vertex[half_edge]
    valence, placed = level.topology.valence[centre], STAR_CENTRE * points[centre]
    outgoing, rows = half_edge.copy(), np.arange(len(half_edge))
    # Round the star neighbour by neighbour, for all stars at once.
    for turn in range(valence.max(initial=0)):
        rows = rows[valence[rows] > turn]
        weights = star_weights(valence[rows], turn)
        placed[rows] += weights[:, None] * points[vertex[next_corner(outgoing[rows])]]
        outgoing[rows] = twins[_previous(outgoing[rows])]
    return placed


def _eight_points(
    level: Level, twins: Int[np.ndarray, " H"], edges: Int[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    points, half_edges = level.points, level.topology.half_edges[edges]
    a, b = points[edges_of(level)[edges]].transpose(1, 0, 2)
    c, d = points[level.topology.corners[_previous(half_edges)]].transpose(1, 0, 2)
    placed = ENDPOINT * (a + b) + OPPOSITE * (c + d)
    for half_edge in half_edges.T:
        after = next_corner(half_edge)
        for wing in (after, next_corner(after)):
            placed += WING * _across(level, twins, wing)
    return placed


def _across(
    level: Level, twins: Int[np.ndarray, " H"], half_edge: Int[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    """Return the vertex beyond each half-edge; its own face's vertex reflected where none is."""
    points, vertex, other = level.points, level.topology.corners, twins[half_edge]
    beyond = points[vertex[_previous(np.where(other < 0, half_edge, other))]]
    start, end = vertex[half_edge], vertex[next_corner(half_edge)]
    reflected = points[start] + points[end] - points[vertex[_previous(half_edge)]]
    return np.where((other < 0)[:, None], reflected, beyond)


def _twins(topology: Topology) -> Int[np.ndarray, " H"]:
    """Return the half-edge on the other side of each; −1 where its edge is not interior."""
    twins = np.full(len(topology.corners), -1, dtype=np.int64)
    here, there = topology.half_edges[topology.interior].T
    twins[here], twins[there] = there, here
    return twins


def _previous(half_edge: Int[np.ndarray, "*N"]) -> Int[np.ndarray, "*N"]:
    return next_corner(next_corner(half_edge))


def _boundary_points(level: Level, edges: Int[np.ndarray, " N"]) -> Float[np.ndarray, "N 3"]:
    """Apply the four-point curve rule; where the boundary does not go on, its end is reflected."""
    points, (a, b) = level.points, edges_of(level)[edges].T
    along, back = np.concatenate([a, b]), np.concatenate([b, a])
    neighbour_sum = np.zeros_like(points)
    np.add.at(neighbour_sum, along, points[back])
    passes = np.bincount(along, minlength=len(points)) == 2
    passes &= level.topology.sharp_count == 2 if len(edges) else False

    def beyond(end: Int[np.ndarray, " N"], other: Int[np.ndarray, " N"]) -> np.ndarray:
        next_on_curve = neighbour_sum[end] - points[other]
        return np.where(passes[end][:, None], next_on_curve, 2 * points[end] - points[other])

    return CURVE_NEAR * (points[a] + points[b]) + CURVE_FAR * (beyond(a, b) + beyond(b, a))
