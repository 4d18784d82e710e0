"""One differentiable step of the operator: the kernels of pns_common on torch tensors."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.base.arrays import beside, cross, gather, segment_sum, unit
from pns_common.connectivity.topology import Topology
from pns_common.formula.edge_operator import EdgeOperator
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.levels.step import level_step
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.rules.control_level import control_level
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from pns_common.rules.loop import loop_vertex_rule
from train.refining import AnyScheme


@dataclass(frozen=True, slots=True)
class Step:
    """The refined points, old vertices first, and how far interior edge vertices left Loop's.

    Attributes:
        ratio: ‖q − q0‖ / (C h²) of each interior edge, in [0, 1].
        vertex_ratio: ‖p' − p0‖ / (C h_v²) of each vertex that the vertex rule may move, if any.
    """

    points: Float[Tensor, "N 3"]
    ratio: Float[Tensor, " I"]
    vertex_ratio: Float[Tensor, " M"] | None = None


def refine_once(
    points: Float[Tensor, "V 3"],
    topology: Topology,
    operator: EdgeOperator,
    budget: float,
    vertex_operator: VertexOperator | None = None,
) -> Step:
    """Refine by one step at reference length 1 (the paper's absolute units).

    The operator's network gives corrections at budget 1. Gradients flow to it, and to the points
    if they ask.
    """
    old = (
        loop_vertex_rule if vertex_operator is None else LearnedVertexRule(vertex_operator, budget)
    )
    step = level_step(
        control_level(points, topology), AnyScheme("step", old, LearnedEdgeRule(operator, budget))
    )
    moved = step.vertices.corrected
    return Step(
        points=step.points,
        ratio=gather(step.edges.ratio, topology.interior),
        vertex_ratio=None if moved is None else gather(step.vertices.ratio, np.flatnonzero(moved)),
    )


def displaced(
    points: Float[Tensor, "V 3"],
    topology: Topology,
    displacement: Float[Tensor, "I 3"],
    ratio: Float[Tensor, " I"],
) -> Step:
    """Refine by one step of Loop and move the interior edge vertices."""
    edge_vertices = loop_edge_vertices(points, topology).index_add(
        0, beside(points, topology.interior), displacement
    )
    return Step(torch.cat([loop_vertex_vertices(points, topology), edge_vertices]), ratio)


def vertex_normals(
    points: Float[Tensor, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[Tensor, "V 3"]:
    """Return unit vertex normals, incident faces weighted by area."""
    a, b, c = (gather(points, corner) for corner in faces.T)
    area_vectors = cross(b - a, c - a).repeat(3, 1)
    return unit(segment_sum(area_vectors, faces.T.reshape(-1), len(points)))
