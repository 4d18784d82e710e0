"""PN triangles: each edge bends into a cubic that meets both ends' tangent planes.

Source: Vlachos, Peters, Boyd, Mitchell 2001, Curved PN triangles. One step evaluates the cubic
triangle at its edges' midpoints; repeated steps estimate the normals anew.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from train.baselines.placement import midpoints, placed_edges
from train.connectivity import Connectivity
from train.reference import Step, Surroundings
from train.refining import Method
from train.tensors import dot, unit


def pn_triangles() -> Method:
    """Return the method. Old vertices stay; irregular edges take the midpoint."""
    return Method("pn-triangles", _step)


def cubic_control_point(
    start: Float[Tensor, "N 3"], end: Float[Tensor, "N 3"], normal: Float[Tensor, "N 3"]
) -> Float[Tensor, "N 3"]:
    """Return b = (2 p1 + p2 − ((p2 − p1)·n1) n1) / 3: the third of the edge, onto the plane."""
    return (2 * start + end - dot(end - start, normal)[:, None] * normal) / 3


def _step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
    normals = unit(Surroundings(mesh, points).mean_normal)
    a, b = mesh.edges.T
    start, end = points[a], points[b]
    near_start = cubic_control_point(start, end, normals[a])
    near_end = cubic_control_point(end, start, normals[b])
    # The cubic Bézier curve at ½. It depends on the edge alone, so boundaries need no other rule.
    middle = (start + 3 * near_start + 3 * near_end + end) / 8
    whole = (mesh.paired | mesh.boundary)[:, None]
    edges = torch.where(whole, middle, midpoints(points, mesh))
    return placed_edges(points, mesh, reference_length, edges, points)
