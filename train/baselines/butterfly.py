"""Modified Butterfly subdivision: interpolating, C¹ also at extraordinary vertices.

Source: Zorin, Schröder, Sweldens 1996, Interpolating subdivision for meshes with arbitrary
topology. On the regular grid this is the eight-point butterfly of Dyn, Levin and Gregory 1990.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.connectivity.topology import (
    EdgeClass,
    Topology,
    next_corner,
    sharp_edge_count,
)
from pns_common.schemes import ControlLevel, Placement, Scheme
from train.baselines.placement import kept_vertices, placed_edges

REGULAR_VALENCE = 6
ENDPOINT, OPPOSITE, WING = 1 / 2, 1 / 8, -1 / 16
STAR_CENTRE = 3 / 4
CURVE_NEAR, CURVE_FAR = 9 / 16, -1 / 16


def modified_butterfly() -> Scheme:
    """Return the scheme. Old vertices stay; irregular edges take the midpoint."""
    return Scheme("butterfly", kept_vertices, _edge_rule)


def butterfly_edge_vertices(
    points: Float[np.ndarray, "V 3"], topology: Topology
) -> Float[np.ndarray, "E 3"]:
    """Return one vertex for each edge.

    An interior edge takes the star rule of its extraordinary end, the mean of both where both ends
    are, else the eight-point rule. What the eight-point stencil misses beyond a boundary is
    reflected across it, and a vertex on a boundary counts as regular, as in the source.
    """
    placed = points[topology.edges].mean(axis=1)
    boundary = np.flatnonzero(topology.edge_class == EdgeClass.BOUNDARY)
    placed[boundary] = _boundary_points(points, topology, boundary)
    interior = topology.interior
    if len(interior) == 0:
        return placed
    valence = topology.valence
    extraordinary = _extraordinary(topology, valence)
    star_sum, stars = np.zeros((len(interior), 3)), np.zeros(len(interior))
    twin = _twins(topology)
    for side in range(2):
        # Of the two half-edges of an edge, each starts at another end.
        half_edge = topology.half_edges[interior, side]
        centre = topology.faces.reshape(-1)[half_edge]
        rows = np.flatnonzero(extraordinary[centre])
        star_sum[rows] += _star_points(points, topology, twin, half_edge[rows], valence)
        stars[rows] += 1
    regular = stars == 0
    star_mean = star_sum / np.where(regular, 1, stars)[:, None]
    eight = _eight_points(points, topology, twin, interior)
    placed[interior] = np.where(regular[:, None], eight, star_mean)
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


def _edge_rule(level: ControlLevel) -> Placement:
    return placed_edges(level, butterfly_edge_vertices(level.points, level.topology))


def _extraordinary(topology: Topology, valence: Int[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Return whether a vertex has one closed fan of a valence other than 6 (a star needs three)."""
    return topology.smooth_vertices & (valence >= 3) & (valence != REGULAR_VALENCE)


def _twins(topology: Topology) -> Int[np.ndarray, " H"]:
    """Return for each half-edge the other one of its interior edge; −1 where there is none."""
    twin = np.full(topology.faces.size, -1)
    first, second = topology.half_edges[topology.interior].T
    twin[first], twin[second] = second, first
    return twin


def _previous(half_edge: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    return next_corner(next_corner(half_edge))


def _star_points(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    twin: Int[np.ndarray, " H"],
    half_edge: Int[np.ndarray, " N"],
    valence: Int[np.ndarray, " V"],
) -> Float[np.ndarray, "N 3"]:
    """Apply the star rule at the start of each half-edge, whose end is neighbour 0."""
    vertex = topology.faces.reshape(-1)
    centre = vertex[half_edge]
    placed = STAR_CENTRE * points[centre]
    outgoing, rows = half_edge, np.arange(len(half_edge))
    # Round the star neighbour by neighbour, for all stars at once.
    for turn in range(int(valence[centre].max(initial=0))):
        rows = rows[valence[centre[rows]] > turn]
        end = vertex[next_corner(outgoing[rows])]
        placed[rows] += star_weights(valence[centre[rows]], turn)[:, None] * points[end]
        outgoing = outgoing.copy()
        outgoing[rows] = twin[_previous(outgoing[rows])]
    return placed


def _eight_points(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    twin: Int[np.ndarray, " H"],
    edges: Int[np.ndarray, " N"],
) -> Float[np.ndarray, "N 3"]:
    a, b, c, d = (points[column] for column in topology.stencil[edges].T)
    placed = ENDPOINT * (a + b) + OPPOSITE * (c + d)
    for half_edge in topology.half_edges[edges].T:
        after = next_corner(half_edge)
        for wing in (after, next_corner(after)):
            placed += WING * _across(points, topology, twin, wing)
    return placed


def _across(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    twin: Int[np.ndarray, " H"],
    half_edge: Int[np.ndarray, " N"],
) -> Float[np.ndarray, "N 3"]:
    """Return the vertex beyond each half-edge; its own face's vertex reflected where none is."""
    vertex = topology.faces.reshape(-1)
    other = twin[half_edge]
    beyond = points[vertex[_previous(np.where(other < 0, half_edge, other))]]
    start, end = vertex[half_edge], vertex[next_corner(half_edge)]
    own = vertex[_previous(half_edge)]
    reflected = points[start] + points[end] - points[own]
    return np.where((other < 0)[:, None], reflected, beyond)


def _boundary_points(
    points: Float[np.ndarray, "V 3"], topology: Topology, edges: Int[np.ndarray, " N"]
) -> Float[np.ndarray, "N 3"]:
    """Apply the four-point curve rule; where the boundary does not go on, its end is reflected."""
    a, b = topology.edges[edges].T
    along = topology.edges[edges]
    neighbour_sum = np.zeros_like(points)
    np.add.at(neighbour_sum, along.reshape(-1), points[along[:, ::-1].reshape(-1)])
    passes = np.bincount(along.reshape(-1), minlength=len(points)) == 2
    passes &= sharp_edge_count(topology) == 2

    def beyond(end: np.ndarray, other: np.ndarray) -> np.ndarray:
        next_on_curve = neighbour_sum[end] - points[other]
        return np.where(passes[end][:, None], next_on_curve, 2 * points[end] - points[other])

    return CURVE_NEAR * (points[a] + points[b]) + CURVE_FAR * (beyond(a, b) + beyond(b, a))
