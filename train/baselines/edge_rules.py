"""The paper's baselines that place edge vertices: a blend with Butterfly, and a fitted push."""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from train.baselines.butterfly import butterfly_edge_vertices
from train.baselines.placement import placed_edges
from train.connectivity import Connectivity, connect
from train.data.datasets import Dataset
from train.loop_masks import loop_mask
from train.reference import Step, Surroundings, edge_frames, read_edges
from train.refining import Method
from train.surfaces.implicit import signed_distance, unit_normal
from train.tensors import dot


def curvature_adaptive(gate_sharpness: float) -> Method:
    """Return Loop where the mesh is flat, Butterfly where it bends.

    q = (1 − γ) Loop + γ Butterfly with the operator's own gate γ = tanh(c x²); old vertices,
    boundary and irregular edges are Loop's. Source: paper, Setup, baselines, and metrics.
    """

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        around = Surroundings(mesh, points)
        frames = edge_frames(read_edges(around, first_face=True), first_face=True)
        gate = torch.where(mesh.paired, torch.tanh(gate_sharpness * frames.curvature**2), 0.0)
        loop = loop_mask(mesh)(points)[mesh.vertex_count :]
        edges = loop + gate[:, None] * (butterfly_edge_vertices(points, mesh) - loop)
        placed = placed_edges(points, mesh, reference_length, edges)
        return replace(placed, gate=torch.cat([points.new_zeros(len(points)), gate]))

    return Method("curvature-adaptive", step)


def normal_displacement(scalar: float) -> Method:
    """Return Loop's edge vertex pushed along the mean face normal by one fitted scalar.

    q = q0 + s h N, h the edge's length, so that s has no unit; boundary and irregular edges are
    Loop's. In the spirit of Boubekeur and Alexa 2008 (Phong tessellation); the paper names this
    baseline and gives no formula.
    """

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        loop = loop_mask(mesh)(points)[mesh.vertex_count :]
        edges = loop + scalar * _unit_push(points, mesh)
        return placed_edges(points, mesh, reference_length, edges)

    return Method("normal-displacement", step)


def fit_scalar(dataset: Dataset) -> float:
    """Return the s of least squared distance over a data set.

    To first order the distance at q0 + s h N is d + s h N·n, so s is a ratio of two sums.
    """
    numerator = denominator = 0.0
    for instance in dataset.instances:
        points = torch.tensor(instance.mesh.vertices)
        mesh = connect(instance.mesh.faces, len(points))
        start = loop_mask(mesh)(points)[len(points) + mesh.interior]
        push = _unit_push(points, mesh)[mesh.interior]
        gain = dot(push, unit_normal(instance.surface, start))
        numerator -= float((gain * signed_distance(instance.surface, start)).sum())
        denominator += float((gain**2).sum())
    return numerator / denominator


def _unit_push(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "E 3"]:
    """Return h N of each interior edge; a fallback frame knows no normal of the surface."""
    frames = edge_frames(read_edges(Surroundings(mesh, points), first_face=True), first_face=True)
    push = frames.length[:, None] * frames.axes[:, :, 1]
    return torch.where(frames.degenerate[:, None], 0.0, push)
