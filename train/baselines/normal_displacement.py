"""Normal displacement: Loop's edge vertex pushed along the mean face normal by one fitted scalar.

q = q0 + s h N, h the edge's length. In the spirit of Boubekeur and Alexa 2008 (Phong tessellation);
the paper names this baseline and gives no formula. The push scales with the mesh, so that s does
not depend on the unit of length.
"""

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import dot
from pns_common.connectivity.topology import Topology, build_topology
from pns_common.geometry.frames import edge_frames, edge_stencil, face_normals
from pns_common.masks.stencils import loop_edge_vertices
from pns_common.schemes import ControlLevel, Placement, Scheme, loop_edge_rule, loop_vertex_rule
from train.baselines.placement import placed_edges
from train.data.datasets import Dataset
from train.surfaces.implicit import signed_distance, unit_normal


def normal_displacement(scalar: float) -> Scheme:
    """Return the scheme with a fitted scalar; boundary and irregular edges are Loop's."""

    def edge_rule(level: ControlLevel) -> Placement:
        positions = loop_edge_rule(level).loop.copy()
        push = _unit_push(level.points, level.topology)
        positions[level.topology.interior] += scalar * push
        return placed_edges(level, positions)

    return Scheme("normal-displacement", loop_vertex_rule, edge_rule)


def fit_scalar(dataset: Dataset) -> float:
    """Return the s of least squared distance over a data set.

    To first order the distance at q0 + s h N is d + s h N·n, so s is a ratio of two sums.
    """
    numerator = denominator = 0.0
    for instance in dataset.instances:
        points = instance.mesh.vertices
        topology = build_topology(instance.mesh.faces, len(points))
        start = loop_edge_vertices(points, topology)[topology.interior]
        gain = dot(_unit_push(points, topology), unit_normal(instance.surface, start))
        numerator -= float((gain * signed_distance(instance.surface, start)).sum())
        denominator += float((gain**2).sum())
    return numerator / denominator


def _unit_push(points: Float[np.ndarray, "V 3"], topology: Topology) -> Float[np.ndarray, "I 3"]:
    """Return h N of each interior edge."""
    interior = topology.interior
    normals = face_normals(points, topology.faces)
    frames = edge_frames(
        edge_stencil(points, normals, topology.stencil[interior], topology.edge_faces[interior])
    )
    # A fallback frame knows no normal of the surface.
    push = frames.length[:, None] * frames.normal
    return np.where(frames.degenerate[:, None], 0.0, push)
