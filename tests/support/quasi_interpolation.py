"""Quasi-interpolation by its definition, and the scale-free rule that one level of it is."""

from dataclasses import replace

import numpy as np
from pns_common.connectivity.topology import build_topology
from pns_common.masks.linear import refine_linear

OPEN_GATES = {"gate_sharpness": 1e12, "vertex_gate_sharpness": 1e9, "budget": 1e6}


def with_card(model, **changes):
    """The same networks under another card."""
    return replace(model, card=replace(model.card, **changes))


def quasi_interpolated(points, faces):
    """Push every vertex along its normal by as much as Loop's limit takes it in, then Loop."""
    topology = build_topology(faces, len(points))
    pushed = points.copy()
    for v in range(len(points)):
        ring = np.unique(topology.edges[(topology.edges == v).any(axis=1)])
        ring = ring[ring != v]
        k = len(ring)
        beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
        limit = (points[v] * 3 / (8 * beta) + points[ring].sum(axis=0)) / (3 / (8 * beta) + k)
        around = faces[(faces == v).any(axis=1)]
        u, w = (
            points[around[:, 1]] - points[around[:, 0]],
            points[around[:, 2]] - points[around[:, 0]],
        )
        normal = np.cross(u, w).sum(axis=0)
        normal /= np.linalg.norm(normal)
        pushed[v] += (points[v] - limit) @ normal * normal
    return refine_linear(pushed, [topology])
