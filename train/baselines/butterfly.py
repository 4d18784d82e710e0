"""Modified Butterfly subdivision: interpolating, C¹ also at extraordinary vertices.

Source: Zorin, Schröder, Sweldens 1996, Interpolating subdivision for meshes with arbitrary
topology. On the regular grid this is the eight-point butterfly of Dyn, Levin and Gregory 1990.
"""

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from train.baselines.placement import midpoints, placed_edges
from train.connectivity import Connectivity, next_corner
from train.reference import Step
from train.refining import Method

REGULAR_VALENCE = 6
ENDPOINT, OPPOSITE, WING = 1 / 2, 1 / 8, -1 / 16
STAR_CENTRE = 3 / 4
CURVE_NEAR, CURVE_FAR = 9 / 16, -1 / 16


def modified_butterfly() -> Method:
    """Return the method. Old vertices stay; irregular edges take the midpoint."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        edges = butterfly_edge_vertices(points, mesh)
        return placed_edges(points, mesh, reference_length, edges, points)

    return Method("butterfly", step)


def butterfly_edge_vertices(
    points: Float[Tensor, "V 3"], mesh: Connectivity
) -> Float[Tensor, "E 3"]:
    """Return one vertex for each edge.

    An interior edge takes the star rule of its extraordinary end, the mean of both where both ends
    are, else the eight-point rule. What the eight-point stencil misses beyond a boundary is
    reflected across it, and a vertex on a boundary counts as regular, as in the source.
    """
    placed, interior = midpoints(points, mesh), mesh.interior
    boundary = torch.nonzero(mesh.boundary)[:, 0]
    placed[boundary] = _boundary_points(points, mesh, boundary)
    # One closed fan of a valence other than 6; a star needs three.
    extraordinary = mesh.ringed & (mesh.sharpest[0][:, 0] == 0)
    extraordinary &= (mesh.valence >= 3) & (mesh.valence != REGULAR_VALENCE)
    star_sum, stars = torch.zeros_like(placed), torch.zeros(len(placed))
    # Of the two half-edges of an edge, each starts at another end.
    for half_edge in mesh.half_edges[interior].T:
        rows = extraordinary[mesh.faces.reshape(-1)[half_edge]]
        star_sum[interior[rows]] += _star_points(points, mesh, half_edge[rows])
        stars[interior[rows]] += 1
    regular = interior[stars[interior] == 0]
    placed[regular] = _eight_points(points, mesh, regular)
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
    points: Float[Tensor, "V 3"], mesh: Connectivity, half_edge: Int[Tensor, " N"]
) -> Float[Tensor, "N 3"]:
    """Apply the star rule at the start of each half-edge, whose end is neighbour 0."""
    vertex, twins = mesh.faces.reshape(-1), mesh.twins
    centre = vertex[half_edge]
    valence, placed = mesh.valence[centre], STAR_CENTRE * points[centre]
    outgoing, rows = half_edge.clone(), torch.arange(len(half_edge))
    # Round the star neighbour by neighbour, for all stars at once.
    for turn in range(int(valence.amax()) if len(valence) else 0):
        rows = rows[valence[rows] > turn]
        weights = torch.from_numpy(star_weights(valence[rows].numpy(), turn))
        placed[rows] += weights[:, None] * points[vertex[next_corner(outgoing[rows])]]
        outgoing[rows] = twins[_previous(outgoing[rows])]
    return placed


def _eight_points(
    points: Float[Tensor, "V 3"], mesh: Connectivity, edges: Int[Tensor, " N"]
) -> Float[Tensor, "N 3"]:
    a, b, c, d = (points[column] for column in mesh.stencil[edges].T)
    placed = ENDPOINT * (a + b) + OPPOSITE * (c + d)
    for half_edge in mesh.half_edges[edges].T:
        after = next_corner(half_edge)
        for wing in (after, next_corner(after)):
            placed += WING * _across(points, mesh, wing)
    return placed


def _across(
    points: Float[Tensor, "V 3"], mesh: Connectivity, half_edge: Int[Tensor, " N"]
) -> Float[Tensor, "N 3"]:
    """Return the vertex beyond each half-edge; its own face's vertex reflected where none is."""
    vertex, other = mesh.faces.reshape(-1), mesh.twins[half_edge]
    beyond = points[vertex[_previous(torch.where(other < 0, half_edge, other))]]
    start, end = vertex[half_edge], vertex[next_corner(half_edge)]
    reflected = points[start] + points[end] - points[vertex[_previous(half_edge)]]
    return torch.where((other < 0)[:, None], reflected, beyond)


def _previous(half_edge: Int[Tensor, " N"]) -> Int[Tensor, " N"]:
    return next_corner(next_corner(half_edge))


def _boundary_points(
    points: Float[Tensor, "V 3"], mesh: Connectivity, edges: Int[Tensor, " N"]
) -> Float[Tensor, "N 3"]:
    """Apply the four-point curve rule; where the boundary does not go on, its end is reflected."""
    a, b = mesh.edges[edges].T
    along, back = torch.cat([a, b]), torch.cat([b, a])
    neighbour_sum = torch.zeros_like(points).index_add(0, along, points[back])
    count = torch.bincount(along, minlength=len(points))
    passes = (count == 2) & (mesh.sharpest[0][:, 2] == 0)

    def beyond(end: Int[Tensor, " N"], other: Int[Tensor, " N"]) -> Float[Tensor, "N 3"]:
        next_on_curve = neighbour_sum[end] - points[other]
        return torch.where(passes[end][:, None], next_on_curve, 2 * points[end] - points[other])

    return CURVE_NEAR * (points[a] + points[b]) + CURVE_FAR * (beyond(a, b) + beyond(b, a))
