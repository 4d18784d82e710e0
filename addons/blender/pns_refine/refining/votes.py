"""Values that only name something, at new vertices and corners: one of their parents' values."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.kernels.loop import EDGE_ENDPOINT, EDGE_OPPOSITE
from pns_common.topology import EdgeClass, Topology

from .steps import Steps

# The children of a face, by its corners a, b, c (0, 1, 2) and edge vertices ab, bc, ca (3, 4, 5).
CHILDREN = np.array([(0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)])


def vote_at_points(values: Shaped[np.ndarray, "V K"], steps: Steps) -> Shaped[np.ndarray, "W K"]:
    """Let old vertices keep their value; an edge vertex has that of most of its parents.

    Parents vote with the weight that Loop's edge mask gives them; of two equals, the endpoint of
    lower number wins.
    """
    for step in steps.steps:
        values = np.concatenate([values, values[_elected(values, step.topology)]])
    return values


def vote_at_corners(values: Shaped[np.ndarray, "C K"], levels: int) -> Shaped[np.ndarray, "D K"]:
    """Vote on values at three corners a face, in faces' order, for those of the children.

    A child at a corner has that corner's value; the one in the middle has at each of its corners
    that of the corner before.
    """
    nearest = np.where(CHILDREN < 3, CHILDREN, CHILDREN - 3)
    nearest[:3] = np.arange(3)[:, None]
    for _ in range(levels):
        values = values.reshape(-1, 3, values.shape[-1])[:, nearest.reshape(-1)]
        values = values.reshape(-1, values.shape[-1])
    return values


def _elected(values: Shaped[np.ndarray, "V K"], topology: Topology) -> Int[np.ndarray, " E"]:
    """Return for each edge the parent whose value is taken."""
    a, b = topology.edges.T.astype(np.int64)
    c, d = _opposites(topology)
    weight = np.array([EDGE_ENDPOINT, EDGE_ENDPOINT, EDGE_OPPOSITE, EDGE_OPPOSITE])
    parents = [a, b, np.where(c < 0, a, c), np.where(d < 0, b, d)]
    rows = [values[parent] for parent in parents]
    votes = np.zeros((4, len(a)))
    for voter in range(4):
        for other in range(4):
            votes[voter] += weight[other] * (rows[voter] == rows[other]).all(axis=1)
    return np.stack(parents)[votes.argmax(axis=0), np.arange(len(a))]


def _opposites(topology: Topology) -> Int[np.ndarray, "2 E"]:
    """Return the vertices opposite to each edge between two faces; −1 at other edges."""
    inside = np.isin(topology.edge_class, (int(EdgeClass.INTERIOR), int(EdgeClass.CREASE)))
    before = topology.half_edges - 1 + 3 * (topology.half_edges % 3 == 0)
    found = topology.corners[np.where(inside[:, None], before, 0)].astype(np.int64)
    return np.where(inside[:, None], found, -1).T
