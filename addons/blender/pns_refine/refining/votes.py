"""Values that only name something, at new vertices and corners: one of their parents' values."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.connectivity.topology import CHILDREN, Topology
from pns_common.masks.stencils import EDGE_ENDPOINT, EDGE_OPPOSITE

from .steps import Steps


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
    a, b, c, d = (topology.stencil[:, column] for column in range(4))
    weight = np.array([EDGE_ENDPOINT, EDGE_ENDPOINT, EDGE_OPPOSITE, EDGE_OPPOSITE])
    parents = [a, b, np.where(c < 0, a, c), np.where(d < 0, b, d)]
    rows = [values[parent] for parent in parents]
    votes = np.zeros((4, len(a)))
    for voter in range(4):
        for other in range(4):
            votes[voter] += weight[other] * (rows[voter] == rows[other]).all(axis=1)
    return np.stack(parents)[votes.argmax(axis=0), np.arange(len(a))]
