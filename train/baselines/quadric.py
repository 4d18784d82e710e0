"""1-ring quadric fit: each vertex sees a paraboloid through itself, fitted to its neighbours.

An edge vertex is the mean of what the paraboloids of both ends have at the edge's midpoint. In the
spirit of Garland and Heckbert 1997 (quadric error metrics); the paper names this baseline and gives
no formula. The height is w = g·u + ½ uᵀ H u along the vertex normal, by least squares; a ring with
fewer than five neighbours takes the solution of least norm.
"""

import numpy as np
from jaxtyping import Float, Int

from pns_common import Scheme
from pns_common.kernels.connectivity import INTERIOR
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.baselines.placement import edges_of, midpoints, placed_edges, vertex_normals

# Of the normal equations in ring units, so of squared condition: below it a direction is not seen.
SMALLEST_SINGULAR = 1e-10


def quadric_fit() -> Scheme:
    """Return the scheme. Old vertices stay; boundary and irregular edges take the midpoint."""
    return Scheme("quadric", rule=_rule, learned_levels=None)


def quadric_edge_points(
    points: Float[np.ndarray, "V 3"],
    edges: Int[np.ndarray, "E 2"],
    axes: Float[np.ndarray, "V 3"],
) -> Float[np.ndarray, "E 3"]:
    """Return the mean of both ends' paraboloids at each midpoint; `axes` are the height axes.

    Exact on paraboloids of height along a common axis.
    """
    centre = edges.reshape(-1)
    neighbour = edges[:, ::-1].reshape(-1)
    u, v = _tangents(axes)
    offset = points[neighbour] - points[centre]
    count = len(points)
    valence = np.maximum(np.bincount(centre, minlength=count), 1)
    ring = np.bincount(centre, np.linalg.norm(offset, axis=1), count) / valence
    ring = np.where(ring > 0, ring, 1.0)[centre]
    x, y, w = (np.einsum("nk,nk->n", offset, axis[centre]) / ring for axis in (u, v, axes))
    basis = _monomials(x, y)
    normal_matrix, right = np.zeros((count, 5, 5)), np.zeros((count, 5))
    np.add.at(normal_matrix, centre, basis[:, :, None] * basis[:, None, :])
    np.add.at(right, centre, basis * w[:, None])
    inverse = np.linalg.pinv(normal_matrix, rcond=SMALLEST_SINGULAR, hermitian=True)
    coefficients = np.einsum("nij,nj->ni", inverse, right)
    height = (_monomials(x / 2, y / 2) * coefficients[centre]).sum(axis=1)
    local = (x / 2)[:, None] * u[centre] + (y / 2)[:, None] * v[centre]
    placed = points[centre] + ring[:, None] * (local + height[:, None] * axes[centre])
    return placed.reshape(-1, 2, 3).mean(axis=1)


def _rule(level: Level) -> Additions:
    fitted = quadric_edge_points(level.points, edges_of(level), vertex_normals(level))
    interior = (level.topology.edge_class == INTERIOR)[:, None]
    return placed_edges(level, np.where(interior, fitted, midpoints(level)), level.points)


def _monomials(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return x, y and the second powers, scaled so that the least norm does not see the axes."""
    return np.stack([x, y, x * x / 2, x * y / np.sqrt(2), y * y / 2], axis=1)


def _tangents(
    axes: Float[np.ndarray, "V 3"],
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "V 3"]]:
    """Return two unit vectors across each axis; the fit does not depend on which."""
    # The coordinate direction least along the axis.
    seed = np.eye(3)[np.abs(axes).argmin(axis=1)]
    u = np.cross(axes, seed)
    u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-300)
    return u, np.cross(axes, u)
