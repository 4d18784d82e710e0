"""Limit masks against what they stand for: Loop's rules applied without end."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology, sharp_edge_count
from pns_common.masks.limit import (
    limit_normals,
    limit_positions,
)
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.stars import creased, star, stepped


def same_limits(points, topology, tolerance=1e-9):
    """The limit of a mesh is the limit of its refinement: the masks are eigenvectors."""
    refined, after = stepped(points, topology)
    count = len(points)
    ours, theirs = limit_positions(points, topology), limit_positions(refined, after)
    size = max(1.0, np.abs(points).max())
    np.testing.assert_allclose(theirs[:count], ours, rtol=0, atol=1e-12 * size)
    now, then = limit_normals(points, topology), limit_normals(refined, after)
    # Corner i of face f is corner i of ... its i-th child.
    corners = 12 * (np.arange(topology.faces.size) // 3) + 3 * (np.arange(topology.faces.size) % 3)
    before = now.sectors[now.sector_of_corner]
    np.testing.assert_allclose(
        then.sectors[then.sector_of_corner][corners], before, rtol=0, atol=tolerance
    )
    np.testing.assert_allclose(then.vertices[:count], now.vertices, rtol=0, atol=tolerance)


@pytest.mark.parametrize("k", [3, 4, 5, 6, 7, 9, 20])
def test_closed_fans_keep_position_and_normal_from_level_to_level(k):
    points, faces = star(k, closed=True)
    same_limits(points, build_topology(faces, len(points)))


@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 6, 8])
def test_boundary_fans_keep_position_and_normal_from_level_to_level(k):
    points, faces = star(k, closed=False)
    same_limits(points, build_topology(faces, len(points)))


@pytest.mark.parametrize("k", [3, 4, 5, 6, 7, 9, 12])
@pytest.mark.parametrize("sharp", [(1,), (1, 3)])
def test_darts_and_creases_keep_position_and_normal(k, sharp):
    points, faces = star(k, closed=True)
    topology = build_topology(faces, len(points))
    topology = with_creases(topology, np.array([[0, j] for j in sharp]))
    assert sharp_edge_count(topology)[0] == len(sharp)
    same_limits(points, topology)


def test_closed_fans_that_meet_at_a_vertex_end_in_tips():
    """Their rings' means draw together by 5/8 a step; the rings get smaller by 1/2."""
    points, faces = star(6, closed=True)
    other = np.where(faces == 0, 0, faces + len(points) - 1)[:, ::-1]
    points = np.concatenate([points, [0, 0, 0.6] - points[1:]])
    topology = build_topology(np.concatenate([faces, other]), len(points))
    apart, wide = [], []
    for _ in range(6):
        points, topology = stepped(points, topology)
        rings = []
        for side in np.split(np.arange(len(topology.faces)), 2):
            around = topology.faces[side][(topology.faces[side] == 0).any(axis=1)]
            rings.append(points[np.setdiff1d(around, [0])])
        apart.append(np.linalg.norm(rings[0].mean(axis=0) - rings[1].mean(axis=0)))
        wide.append(np.ptp(rings[0], axis=0).max())
    np.testing.assert_allclose(np.divide(apart[1:], apart[:-1]), 5 / 8, rtol=1e-9)
    np.testing.assert_allclose(wide[-1] / wide[-2], 1 / 2, rtol=0.05)


@given(manifolds(), st.integers(0, 2**31))
def test_any_creases_on_any_manifold(mesh, seed):
    points = mesh.vertices
    topology = creased(points, mesh.faces, seed)
    refined, after = stepped(points, topology)
    ours, theirs = limit_positions(points, topology), limit_positions(refined, after)
    np.testing.assert_allclose(theirs[: len(points)], ours, rtol=0, atol=1e-12)


@given(soups())
def test_positions_of_soups_are_limits_too(mesh):
    """Irregular edges, bow-ties, faces with a repeated vertex: every vertex has a mask."""
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology = build_topology(mesh.faces, len(points))
    level = points, topology
    for _ in range(2):
        ours, level = limit_positions(*level), stepped(*level)
        np.testing.assert_allclose(limit_positions(*level)[: len(ours)], ours, rtol=0, atol=1e-12)
    normals = limit_normals(points, topology).vertices
    length = np.linalg.norm(normals, axis=1)
    assert (np.isclose(length, 1) | (length == 0)).all()


@given(manifolds(), st.integers(0, 2**31))
def test_numpy_and_torch_agree(mesh, seed):
    topology = creased(mesh.vertices, mesh.faces, seed)
    tensor = torch.tensor(mesh.vertices)
    np.testing.assert_allclose(
        limit_positions(tensor, topology).numpy(),
        limit_positions(mesh.vertices, topology),
        rtol=0,
        atol=1e-14,
    )
    np.testing.assert_allclose(
        limit_normals(tensor, topology).sectors.numpy(),
        limit_normals(mesh.vertices, topology).sectors,
        rtol=0,
        atol=1e-9,
    )


def test_torch_differentiates_through_positions_and_normals():
    points, faces = grid(3, bent)
    topology = with_creases(build_topology(faces, len(points)), np.array([[1, 4]]))

    def surface(p):
        return limit_positions(p, topology), limit_normals(p, topology).sectors

    tensor = torch.tensor(points, requires_grad=True)
    assert torch.autograd.gradcheck(surface, (tensor,), fast_mode=True)
