"""Match the edges of a refined mesh with those that they come from."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Int

from .snapshot import Snapshot
from .steps import Steps, edge_numbers


def edge_parents(steps: Steps, snapshot: Snapshot) -> Int[np.ndarray, " E"]:
    """Return the mesh's own edge that each final edge is a piece of; −1 for edges new inside faces.

    An edge between an old vertex and an edge vertex is half of that edge: those inside a face join
    two edge vertices.
    """
    first = steps.steps[0].topology
    parents = np.full(len(first.edges), -1, dtype=np.int64)
    # Diagonals that cut polygons into triangles are no edges of the mesh.
    numbers = edge_numbers(first, snapshot.edges)
    own = np.flatnonzero(numbers >= 0)
    parents[numbers[own]] = own
    topologies = [step.topology for step in steps.steps] + [steps.final]
    for topology, finer in pairwise(topologies):
        low, high = finer.edges[:, 0], finer.edges[:, 1]
        half = low < topology.vertex_count
        parents = np.where(half, parents[np.where(half, high - topology.vertex_count, 0)], -1)
    return parents
