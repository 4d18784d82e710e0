"""One differentiable step of the operator: the kernels of pns_common on torch tensors."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common.arrays import beside, cross, gather, segment_sum, unit
from pns_common.correction import proximity_ratio
from pns_common.edge_operator import EdgeOperator
from pns_common.frames import face_normals
from pns_common.ring_features import look_around
from pns_common.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.topology import Topology
from pns_common.vertex_operator import VertexOperator, smooth_vertices


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
    normals = face_normals(points, topology.faces)
    fields = operator.features.fields(points, topology)
    at = operator.look(points, normals, fields, topology, topology.interior)
    correction = operator.correct(at, budget)
    step = displaced(points, topology, correction.displacement, proximity_ratio(correction))
    if vertex_operator is None:
        return step
    moved = np.flatnonzero(smooth_vertices(topology))
    rings = look_around(points, normals, topology)
    at_vertices = vertex_operator.correct(rings, moved, budget)
    refined = step.points.index_add(0, beside(points, moved), at_vertices.displacement)
    return replace(step, points=refined, vertex_ratio=proximity_ratio(at_vertices))


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
