"""PN triangles: each edge bends into a cubic that meets both ends' tangent planes.

Source: Vlachos, Peters, Boyd, Mitchell 2001, Curved PN triangles. One step evaluates the cubic
triangle at its edges' midpoints; repeated steps estimate the normals anew. With normals split at an
angle, each face bends by normals of its own smooth side; along a split edge both sides share the
tangent of the crease.
"""

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from train.baselines.placement import midpoints, placed_edges
from train.connectivity import Connectivity, next_corner
from train.reference import Step, Surroundings
from train.refining import Method
from train.tensors import dot, unit

# Normals are one whose inner product is nearer to 1.
SAME = 1e-9


def pn_triangles(split: float | None = None) -> Method:
    """Return the method; normals are split at edges that turn by more than an angle, degrees.

    Old vertices stay; irregular edges take the midpoint.
    """

    def step(points: Float[Tensor, "V 3"], mesh: Connectivity, reference_length: float) -> Step:
        around = Surroundings(mesh, points)
        a, b = mesh.edges.T
        start, end = points[a], points[b]
        if split is None:
            normals = unit(around.mean_normal)
            near_start = cubic_control_point(start, end, normals[a])
            near_end = cubic_control_point(end, start, normals[b])
        else:
            corners = _corner_normals(around, np.cos(np.radians(split)))
            near_start = _split_control_point(start, end, corners, mesh, a)
            near_end = _split_control_point(end, start, corners, mesh, b)
        # The cubic Bézier curve at ½. It depends on the edge alone: boundaries need no other rule.
        middle = (start + 3 * near_start + 3 * near_end + end) / 8
        whole = (mesh.paired | mesh.boundary)[:, None] if split is None else mesh.paired[:, None]
        edges = torch.where(whole, middle, midpoints(points, mesh))
        return placed_edges(points, mesh, reference_length, edges, points)

    return Method("pn-triangles", step)


def cubic_control_point(
    start: Float[Tensor, "N 3"], end: Float[Tensor, "N 3"], normal: Float[Tensor, "N 3"]
) -> Float[Tensor, "N 3"]:
    """Return b = (2 p1 + p2 − ((p2 − p1)·n1) n1) / 3: the third of the edge, onto the plane."""
    return (2 * start + end - dot(end - start, normal)[:, None] * normal) / 3


def _corner_normals(around: Surroundings, least: float) -> Float[Tensor, "H 3"]:
    """Return at each corner the mean normal of the faces that smooth edges join it to.

    An edge is smooth where the normals of its faces have at least this inner product.
    """
    mesh, count = around.mesh, around.mesh.faces.numel()
    here, there = mesh.half_edges[mesh.paired].T
    smooth = dot(around.normals[here // 3], around.normals[there // 3]) >= least
    here, there = here[smooth], there[smooth]
    ends = torch.cat([here, next_corner(here)]), torch.cat([next_corner(there), there])
    joins = coo_array((np.ones(len(ends[0])), ends), shape=(count, count))
    group = torch.from_numpy(connected_components(joins, directed=False)[1]).long()
    summed = around.points.new_zeros((count, 3))
    summed = summed.index_add(0, group, around.area_vectors.repeat_interleave(3, dim=0))
    return unit(summed)[group]


def _split_control_point(
    start: Float[Tensor, "E 3"],
    end: Float[Tensor, "E 3"],
    normals: Float[Tensor, "H 3"],
    mesh: Connectivity,
    vertex: Int[Tensor, " E"],
) -> Float[Tensor, "E 3"]:
    """Return the third of each edge, onto the plane of its side, or the line of both sides."""
    corner = mesh.half_edges.clamp(min=0)
    own = mesh.faces.reshape(-1)[corner] == vertex[:, None]
    first, second = normals[torch.where(own, corner, next_corner(corner))].unbind(dim=1)
    crease = unit(torch.linalg.cross(first, second))
    along = start + dot(end - start, crease)[:, None] * crease / 3
    split = (dot(first, second) < 1 - SAME)[:, None]
    return torch.where(split, along, cubic_control_point(start, end, first))
