"""What the baselines share: placements measured against Loop as PNS is."""

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import norm
from pns_common.connectivity.topology import EdgeClass, Topology
from pns_common.schemes import (
    ControlLevel,
    Placement,
    loop_edge_rule,
    loop_vertex_rule,
    placed_at,
)

# The C of the envelope that methods without a budget are measured against.
COMPARED_BUDGET = 0.5


def placed_edges(level: ControlLevel, positions: Float[np.ndarray, "E 3"]) -> Placement:
    """Return edge vertices at `positions`; ratio ‖q − q0‖ R / (C h²) on interior edges."""
    base, interior = loop_edge_rule(level), level.topology.interior
    displacement = positions - base.loop
    a, b = level.topology.edges[interior].T
    envelope = COMPARED_BUDGET * norm(level.points[b] - level.points[a]) ** 2
    ratio = np.zeros(len(positions))
    away = norm(displacement[interior]) * level.reference_length
    ratio[interior] = np.where(envelope > 0, away / np.where(envelope > 0, envelope, 1), 0)
    return Placement(base.loop, displacement, ratio, base.gate, base.degenerate)


def kept_vertices(level: ControlLevel) -> Placement:
    """Leave old vertices where they are: the vertex rule of interpolating schemes."""
    return placed_at(loop_vertex_rule(level), level.points)


def midpoints(level: ControlLevel) -> Float[np.ndarray, "E 3"]:
    """Return the midpoint of every edge."""
    return level.points[level.topology.edges].mean(axis=1)


def is_interior(topology: Topology) -> np.ndarray:
    """Return whether each edge is an interior one, as a column."""
    return (topology.edge_class == EdgeClass.INTERIOR)[:, None]
