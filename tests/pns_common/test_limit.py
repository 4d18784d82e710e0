"""Limit masks against what they stand for: Loop's rules applied without end."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, loop, refine
from pns_common.blocks import Blocks
from pns_common.creases import crease_children, with_creases
from pns_common.edge.frames import face_normals
from pns_common.limit import (
    limit_normals,
    limit_positions,
    refined_limit_normals,
    refined_limit_positions,
)
from pns_common.limit.sectors import sectors
from pns_common.linear import level_topologies, refine_linear
from pns_common.stencils import loop_edge_vertices, loop_vertex_vertices
from pns_common.topology import build_topology, sharp_edge_count, split
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid, icosphere, manifolds, soups


def star(k, closed, seed=0):
    """A vertex with k faces around it and a second ring of nothing."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, k, endpoint=False) if closed else np.linspace(0, 3, k + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([[[0, 0, 0.3]], ring]) + 0.1 * rng.standard_normal((len(ring) + 1, 3))
    faces = [[0, 1 + j, 1 + (j + 1) % len(ring)] for j in range(k)]
    return points, np.array(faces)


def stepped(points, topology):
    """Loop's step of points and topology; creases stay creases."""
    refined = np.concatenate(
        [loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)]
    )
    after = build_topology(split(topology), len(refined))
    return refined, with_creases(after, crease_children(topology))


def creased(points, faces, seed):
    """The topology with a random third of its edges as creases."""
    topology = build_topology(np.array(faces), len(points))
    rng = np.random.default_rng(seed)
    return with_creases(topology, topology.edges[rng.random(len(topology.edges)) < 1 / 3])


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
    proper = ~(np.diff(np.sort(mesh.faces, axis=1), axis=1) == 0).any(axis=1)
    if not proper.any():
        return
    topology = build_topology(mesh.faces[proper], len(points))
    refined, after = stepped(points, topology)
    np.testing.assert_allclose(
        limit_positions(refined, after)[: len(points)],
        limit_positions(points, topology),
        rtol=0,
        atol=1e-12,
    )
    normals = limit_normals(points, topology).vertices
    length = np.linalg.norm(normals, axis=1)
    assert (np.isclose(length, 1) | (length == 0)).all()


@pytest.mark.parametrize("creases", [None, np.array([[7, 8], [8, 14], [14, 15]])])
def test_deep_refinement_arrives_there(creases):
    points, faces = grid(6, bent)
    topologies = level_topologies(faces, len(points), 6, creases)
    deep = refine_linear(points, topologies)
    limit = limit_positions(points, topologies[0])
    np.testing.assert_allclose(deep[: len(points)], limit, rtol=0, atol=2e-4)


@pytest.mark.parametrize("mesh", [bumpy_sphere(3), grid(5, bent), icosphere(0)])
def test_normals_are_those_of_the_faces_of_a_deep_refinement(mesh):
    points, faces = mesh
    deep = refine(Mesh(points, faces), loop(), 6).mesh
    topology = build_topology(np.array(faces), len(points))
    exact = limit_normals(points, topology).vertices
    normals = face_normals(deep.vertices, deep.faces)
    for v in range(len(points)):
        around = normals[(deep.faces == v).any(axis=1)]
        assert (around @ exact[v]).min() > np.cos(0.06)


def test_on_a_sphere_normals_point_outwards_and_on_a_plane_along_its_normal():
    points, faces = icosphere(2)
    normals = limit_normals(points, build_topology(faces, len(points))).vertices
    assert np.sum(normals * points, axis=1).min() > np.cos(0.03)
    flat, faces = grid(5)
    normals = limit_normals(flat, build_topology(faces, len(flat))).vertices
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(flat), 1)), atol=1e-14)


def test_both_sides_of_a_crease_have_their_own_normal():
    """A roof: its ridge is a crease, and the slopes stay flat beside it."""
    points, faces = grid(5, lambda x, y: -np.abs(x))
    topology = build_topology(faces, len(points))
    ridge = np.flatnonzero(points[:, 0] == 0)
    topology = with_creases(topology, np.stack([ridge[:-1], ridge[1:]], axis=1))
    normals = limit_normals(points, topology)
    middle = ridge[2]
    sides = normals.sectors[normals.sector_of_corner][topology.faces.reshape(-1) == middle]
    slopes = np.unique(np.round(sides * np.sqrt(2), 9), axis=0)
    np.testing.assert_allclose(slopes, [[-1, 0, 1], [1, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(normals.vertices[middle], [0, 0, 1], atol=1e-12)


def test_a_crease_that_closes_a_square_is_a_corner_that_stays():
    points, faces = bow_tie()
    topology = build_topology(faces, len(points))
    np.testing.assert_array_equal(limit_positions(points, topology)[0], points[0])
    around = sectors(topology)
    assert np.bincount(around.vertex)[0] == 2  # two fans, two normals


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


def test_masks_are_convex():
    """Unit columns through the masks are the masks: no weight below 0, all sums 1."""
    points, faces = grid(5, bent)
    topology = creased(points, faces, 1)
    weights = limit_positions(np.eye(len(points)), topology)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-14)


@given(manifolds(), st.integers(0, 2**31))
def test_limits_of_a_refined_mesh_need_no_connectivity_of_it(mesh, seed):
    topology = creased(mesh.vertices, mesh.faces, seed)
    refined, after = stepped(mesh.vertices, topology)
    positions = refined_limit_positions(refined, topology)
    np.testing.assert_allclose(positions, limit_positions(refined, after), rtol=0, atol=1e-13)
    normals = refined_limit_normals(refined, topology)
    expected = limit_normals(refined, after).vertices
    np.testing.assert_allclose(normals, expected, rtol=0, atol=1e-9)
    blocked = refined_limit_positions(refined, topology, Blocks(2, 5))
    np.testing.assert_array_equal(blocked, positions)
    tensor = torch.tensor(refined)
    np.testing.assert_allclose(refined_limit_normals(tensor, topology).numpy(), normals, atol=1e-9)
