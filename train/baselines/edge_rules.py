"""The paper's baselines that place edge vertices: a blend with Butterfly, and a fitted push."""

import numpy as np
from jaxtyping import Float

from pns_common import Scheme
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from train.baselines.butterfly import butterfly_edge_vertices
from train.baselines.placement import edge_normals, edges_of, placed_edges
from train.data.datasets import Dataset
from train.surfaces.implicit import signed_distance, unit_normal


def curvature_adaptive(gate_sharpness: float) -> Scheme:
    """Return Loop where the mesh is flat, Butterfly where it bends.

    q = (1 − γ) Loop + γ Butterfly with the operator's own gate γ = tanh(c x²); old vertices,
    boundary and irregular edges are Loop's. Source: paper, Setup, baselines, and metrics.
    """

    def rule(level: Level) -> Additions:
        gate, loop = np.tanh(gate_sharpness * level.edges.jumps**2), _loop_edges(level)
        edges = loop + gate[:, None] * (butterfly_edge_vertices(level) - loop)
        return placed_edges(level, edges, gate=gate)

    return Scheme("curvature-adaptive", rule=rule, learned_levels=None)


def normal_displacement(scalar: float) -> Scheme:
    """Return Loop's edge vertex pushed along the mean face normal by one fitted scalar.

    q = q0 + s h N, h the edge's length, so that s has no unit; boundary and irregular edges are
    Loop's. In the spirit of Boubekeur and Alexa 2008 (Phong tessellation); the paper names this
    baseline and gives no formula.
    """

    def rule(level: Level) -> Additions:
        return placed_edges(level, _loop_edges(level) + scalar * _unit_push(level))

    return Scheme("normal-displacement", rule=rule, learned_levels=None)


def fit_scalar(dataset: Dataset) -> float:
    """Return the s of least squared distance over a data set.

    To first order the distance at q0 + s h N is d + s h N·n, so s is a ratio of two sums.
    """
    numerator = denominator = 0.0
    for instance in dataset.instances:
        mesh = instance.mesh
        level = Level(mesh.vertices, mesh.topology(), LOOP, None, Blocks())
        rows = level.topology.interior
        start, push = _loop_edges(level)[rows], _unit_push(level)[rows]
        gain = (push * unit_normal(instance.surface, start)).sum(axis=1)
        numerator -= float((gain * signed_distance(instance.surface, start)).sum())
        denominator += float((gain**2).sum())
    return numerator / denominator


def _loop_edges(level: Level) -> Float[np.ndarray, "E 3"]:
    return level.base.place(level.points, level.topology, level.blocks)[len(level.points) :]


def _unit_push(level: Level) -> Float[np.ndarray, "E 3"]:
    """Return h N of each interior edge, N at a right angle to it."""
    start, end = level.points[edges_of(level)].transpose(1, 0, 2)
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    along, normal = (end - start) / np.where(length > 0, length, 1.0), edge_normals(level)
    normal = normal - (normal * along).sum(axis=1, keepdims=True) * along
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return length * normal / np.where(size > 0, size, 1.0)
