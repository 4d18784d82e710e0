"""Loop's masks alone, over any columns: what follows a mesh's vertices without being a position.

Skin weights and morph deltas go through the stencils that move the vertices; the learned correction
is no part of it, so the result is linear in the columns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from pns_common.creases import crease_children, with_creases
from pns_common.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.topology import Topology, build_topology, split


def level_topologies(
    faces: Int[np.ndarray, "F 3"],
    vertex_count: int,
    levels: int,
    creases: Int[np.ndarray, "N 2"] | None = None,
) -> list[Topology]:
    """The topologies that ``levels`` steps of ``refine`` go through, control mesh first."""
    topologies: list[Topology] = []
    for _ in range(levels):
        topology = build_topology(faces, vertex_count)
        if creases is not None:
            topology = with_creases(topology, creases)
            creases = crease_children(topology)
        topologies.append(topology)
        faces, vertex_count = split(topology), vertex_count + len(topology.edges)
    return topologies


def refine_linear(
    columns: Float[np.ndarray, "V K"], topologies: Sequence[Topology]
) -> Float[np.ndarray, "W K"]:
    """Columns at the refined vertices: Loop's masks, level by level."""
    for topology in topologies:
        vertices = loop_vertex_vertices(columns, topology)
        columns = np.concatenate([vertices, loop_edge_vertices(columns, topology)])
    return columns
