"""Curvature-adaptive blend: Loop where the mesh is flat, Butterfly where it bends.

q = (1 − γ) Loop + γ Butterfly with the operator's own gate γ = tanh(c x²) and nothing learned; old
vertices follow Loop's rule, as they do in PNS. Source: paper, Setup, baselines, and metrics.
"""

import numpy as np

from pns_common.formula.correction import curvature_gate
from pns_common.geometry.frames import edge_frames, edge_stencil
from pns_common.schemes import ControlLevel, Placement, Scheme, loop_edge_rule, loop_vertex_rule
from train.baselines.butterfly import butterfly_edge_vertices
from train.baselines.placement import placed_edges


def curvature_adaptive(gate_sharpness: float) -> Scheme:
    """Return the scheme; boundary and irregular edges are Loop's."""
    gate = curvature_gate(gate_sharpness)

    def edge_rule(level: ControlLevel) -> Placement:
        topology = level.topology
        interior = topology.interior
        stencil, faces = topology.stencil[interior], topology.edge_faces[interior]
        frames = edge_frames(edge_stencil(level.points, level.normals, stencil, faces))
        gamma = gate(frames.curvature)
        positions = loop_edge_rule(level).loop.copy()
        butterfly = butterfly_edge_vertices(level.points, topology)[interior]
        positions[interior] += gamma[:, None] * (butterfly - positions[interior])
        placement = placed_edges(level, positions)
        whole = np.zeros(len(positions))
        whole[interior] = gamma
        return Placement(
            placement.loop, placement.displacement, placement.ratio, whole, placement.degenerate
        )

    return Scheme("curvature-adaptive", loop_vertex_rule, edge_rule)
