"""What every method must be: a scheme for any mesh, over and over, that turns with the mesh."""

import numpy as np
import pytest
from hypothesis import given, settings

from pns_common import Mesh, loop, refine
from pns_common.connectivity.topology import EdgeClass, build_topology
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, rotation, soups, three_pages
from tests.support.methods import BASELINES, INTERPOLATING

each_baseline = pytest.mark.parametrize("name", BASELINES)


@each_baseline
@settings(max_examples=15)
@given(mesh=soups())
def test_refines_any_mesh_to_finite_points(name, mesh):
    refined = refine(mesh, BASELINES[name], levels=2, threads=1)
    assert np.isfinite(refined.mesh.vertices).all()
    assert len(refined.mesh.faces) == 16 * len(mesh.faces)


@each_baseline
@settings(max_examples=15)
@given(mesh=manifolds())
def test_commutes_with_rigid_motion(name, mesh):
    turn = rotation(np.random.default_rng(3))
    shift = np.array([3.0, -1.0, 0.5])
    moved = Mesh(mesh.vertices @ turn.T + shift, mesh.faces)
    here = refine(mesh, BASELINES[name], 1, threads=1).mesh.vertices
    there = refine(moved, BASELINES[name], 1, threads=1).mesh.vertices
    np.testing.assert_allclose(there, here @ turn.T + shift, atol=1e-6)


@pytest.mark.parametrize("name", sorted(set(BASELINES) - {"normal-displacement"}))
def test_planar_input_stays_in_its_plane(name):
    vertices, faces = grid(6)
    refined = refine(Mesh(vertices, faces), BASELINES[name], levels=3, threads=1).mesh
    np.testing.assert_allclose(refined.vertices[:, 2], 0, atol=1e-14)


@each_baseline
def test_irregular_edges_take_the_midpoint(name):
    vertices, faces = three_pages()
    topology = build_topology(faces, len(vertices))
    (edge,) = np.flatnonzero(topology.edge_class == EdgeClass.IRREGULAR)
    refined = refine(Mesh(vertices, faces), BASELINES[name], 1, threads=1).mesh.vertices
    middle = vertices[topology.edges[edge]].mean(axis=0)
    np.testing.assert_allclose(refined[len(vertices) + edge], middle)


@pytest.mark.parametrize("name", INTERPOLATING)
def test_interpolating_methods_keep_old_vertices(name):
    vertices, faces = bumpy_sphere()
    refined = refine(Mesh(vertices, faces), BASELINES[name], levels=2, threads=1).mesh
    np.testing.assert_allclose(refined.vertices[: len(vertices)], vertices, atol=1e-15)


@pytest.mark.parametrize("name", sorted(set(BASELINES) - set(INTERPOLATING)))
def test_approximating_methods_move_old_vertices_as_loop_does(name):
    vertices, faces = grid(6, bent)
    mesh = Mesh(vertices, faces)
    expected = refine(mesh, loop(), 1, threads=1).mesh.vertices[: len(vertices)]
    moved = refine(mesh, BASELINES[name], 1, threads=1).mesh.vertices[: len(vertices)]
    np.testing.assert_array_equal(moved, expected)


def test_the_ratio_is_the_distance_from_loop_in_envelopes_of_half_a_curvature():
    vertices, faces = grid(6, bent)
    mesh = Mesh(vertices, faces)
    topology = build_topology(faces, len(vertices))
    refined = refine(mesh, BASELINES["butterfly"], 1, reference_length=1.0, threads=1)
    smooth = refine(mesh, loop(), 1, reference_length=1.0, threads=1).mesh.vertices
    a, b = vertices[topology.edges].transpose(1, 0, 2)
    away = np.linalg.norm(refined.mesh.vertices - smooth, axis=1)[len(vertices) :]
    ratio = away / (0.5 * ((b - a) ** 2).sum(axis=1))
    interior = topology.interior
    np.testing.assert_allclose(refined.ratio[len(vertices) + interior], ratio[interior])
    assert refined.report["levels"][0]["proximity_ratio"]["max"] == pytest.approx(
        ratio[interior].max()
    )
