"""Curves: boundaries and creases, which become cubic B-splines, and the prior along them.

A B-spline runs inside the bends of its polygon: the limit of a vertex p between a and b is
p + (a + b − 2 p) / 6. Pushing p the other way, across the curve, undoes that:

    d_p = −γ_p (w₂ − w₃) (u − (u · t) t) / 3     u = (a + b) / 2 − p, t the direction from a to b

with a, b the ends of the two sharpest edges at p, w₂ and w₃ the weights of its second and third
sharpest (``topology.SharpVertices``), γ_p = tanh(c_v x_p) f(x_p), x_p = 1 − cos of the turning
angle at p: 0 where the curve is straight, and 0 at corners. Nothing here
reads the surface beside the curve, so two meshes that share a boundary and R move it alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import connectivity
from pns_common.kernels.loop import CURVE_CENTRE, CURVE_NEIGHBOUR, MIDPOINT
from pns_common.mesh.topology import Topology

# f falls from 1 where a curve turns by 45 degrees to 0 at 75, as 1 − cos does.
BEND, CORNER = 1 - math.cos(math.radians(45)), 1 - math.cos(math.radians(75))
TWO = 2


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves of a mesh: its edges of sharpness above 0 that are not irregular.

    Attributes:
        movable: (V,) vertices with w₂ > w₃, on no irregular edge.
        rows: their numbers.
        sides: (N, 2) the two neighbours of each along the curve.
        a, b: (N, 3) from each to these.
        ends: (K, 2) ends of the curve edges that end at a movable vertex.
        new_rows: (N + K,) new vertices on curves, rows of the refined mesh: movable vertices, then
            the vertices of these edges.
        shares: how far each is on a curve: w₂ − w₃, and w of these edges.
        squares: their h²: mean square of both spokes; square of the edge's length.
        shared: (W,) new vertices that a boundary alone places.
    """

    movable: Bool[np.ndarray, " V"]
    rows: Integer[np.ndarray, " N"]
    sides: Integer[np.ndarray, "N 2"]
    a: Float[np.ndarray, "N 3"]
    b: Float[np.ndarray, "N 3"]
    ends: Integer[np.ndarray, "K 2"]
    new_rows: Integer[np.ndarray, " M"]
    shares: Float[np.ndarray, " M"]
    squares: Float[np.ndarray, " M"]
    shared: Bool[np.ndarray, " W"]


def find_curves(
    points: Float[np.ndarray, "V 3"], mesh: Topology, row_count: int | None = None
) -> Curves:
    """Find the curves of a mesh; ``row_count`` counts all vertices of the refined mesh."""
    count, kinds, sharp = mesh.vertex_count, mesh.edge_class, mesh.sharpest
    edge_count = len(mesh.edges)
    shared = np.zeros(row_count or count + edge_count, dtype=bool)
    weights, neighbours = np.zeros((count, 3)), np.zeros((count, 2), dtype=np.int64)
    if sharp is not None:
        weights, neighbours = sharp.weights, sharp.neighbours
    share = weights[:, 1] - weights[:, 2]
    irregular = kinds == connectivity.IRREGULAR
    movable = share > 0
    movable[mesh.edges[irregular].reshape(-1)] = False
    rows = np.flatnonzero(movable)
    sides = neighbours[rows]
    a, b = (points[sides[:, side]] - points[rows] for side in (0, 1))
    edges = np.flatnonzero((mesh.sharpness > 0) & ~irregular)
    ends = mesh.edges[edges]
    moves = movable[ends[:, 0]] | movable[ends[:, 1]]
    edges, ends = edges[moves], ends[moves]
    along = points[ends[:, 1]] - points[ends[:, 0]]
    on_boundary = kinds == connectivity.BOUNDARY
    if on_boundary.any():
        alone = weights[:, 2] == mesh.corner_weights
        of_boundary = np.bincount(mesh.edges[on_boundary].reshape(-1), minlength=count)
        shared[:count] = movable & alone & (of_boundary == TWO)
        shared[count : count + edge_count] = on_boundary
    new_rows = np.concatenate([rows, count + edges])
    shares = np.concatenate([share[rows], mesh.sharpness[edges]])
    squares = np.concatenate([(_square(a) + _square(b)) / 2, _square(along)])
    return Curves(movable, rows, sides, a, b, ends, new_rows, shares, squares, shared)


def curve_pushes(curves: Curves, gate_sharpness: float) -> Float[np.ndarray, "V 3"]:
    """Return d of all vertices, 0 beside curves; ``gate_sharpness`` is c_v."""
    a, b = curves.a, curves.b
    gate = np.tanh(gate_sharpness * _turning(curves)) * (1 - corner_shares(curves))
    along, middle = _unit(b - a), (a + b) / 2
    off = middle - np.einsum("ij,ij->i", middle, along)[:, None] * along
    pushes = np.zeros((len(curves.movable), 3))
    pushes[curves.rows] = -(curves.shares[: len(curves.rows)] * gate / 3)[:, None] * off
    return pushes


def corner_shares(curves: Curves) -> Float[np.ndarray, " N"]:
    """Return 1 − f of the vertices ``curves.rows``: 1 at corners, from a turn of 75 degrees on."""
    return np.clip((_turning(curves) - BEND) / (CORNER - BEND), 0.0, 1.0)


def _turning(curves: Curves) -> Float[np.ndarray, " N"]:
    """Return 1 − cos of the turning angles."""
    return 1 + np.einsum("ij,ij->i", _unit(curves.a), _unit(curves.b))


def curve_prior(curves: Curves, pushes: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "M 3"]:
    """Return D at the new vertices of curves: the curve masks of the base scheme, of ``pushes``."""
    first, second = (pushes[curves.sides[:, side]] for side in (0, 1))
    vertices = CURVE_CENTRE * pushes[curves.rows] + CURVE_NEIGHBOUR * (first + second)
    edges = MIDPOINT * (pushes[curves.ends[:, 0]] + pushes[curves.ends[:, 1]])
    return np.concatenate([vertices, edges])


def _square(v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    return np.einsum("ij,ij->i", v, v)


def _unit(v: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    length = np.sqrt(_square(v))
    return v / np.where(length > 0, length, np.inf)[:, None]
