"""Curvature-adaptive blend: Loop where the mesh is flat, Butterfly where it bends.

q = (1 − γ) Loop + γ Butterfly with the operator's own gate γ = tanh(c x²) and nothing learned; old
vertices follow Loop's rule, as they do in PNS. Source: paper, Setup, baselines, and metrics.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from train.baselines.butterfly import butterfly_edge_vertices
from train.baselines.placement import placed_edges
from train.connectivity import Connectivity
from train.loop_masks import loop_mask
from train.reference import Step, Surroundings, edge_frames, read_edges
from train.refining import Method


def curvature_adaptive(gate_sharpness: float) -> Method:
    """Return the method; boundary and irregular edges are Loop's."""

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        around = Surroundings(mesh, points)
        frames = edge_frames(read_edges(around, first_face=True), first_face=True)
        gate = torch.where(mesh.paired, torch.tanh(gate_sharpness * frames.curvature**2), 0.0)
        loop = loop_mask(mesh)(points)[mesh.vertex_count :]
        edges = loop + gate[:, None] * (butterfly_edge_vertices(points, mesh) - loop)
        placed = placed_edges(points, mesh, reference_length, edges)
        return replace(placed, gate=torch.cat([points.new_zeros(len(points)), gate]))

    return Method("curvature-adaptive", step)
