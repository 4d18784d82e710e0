"""Loop's masks against independent oracles: trimesh, libigl, the spectrum, and B-spline facts."""

import igl
import numpy as np
import pytest
import trimesh

from pns_common import Mesh, loop
from pns_common.mesh.topology import EdgeClass, build_topology
from pns_common.schemes.loop_weights import beta as loop_beta
from tests.support.control_points import refine
from tests.support.meshes import (
    TETRAHEDRON,
    bent,
    bow_tie,
    bumpy_sphere,
    grid,
    three_pages,
)
from tests.support.shared import shared_path


def match(positions, expected):
    """Largest distance from a point of one set to the nearest of the other, both ways."""
    apart = np.linalg.norm(positions[:, None] - expected[None], axis=-1)
    return max(apart.min(axis=0).max(), apart.min(axis=1).max())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("levels", [1, 2])
def test_closed_meshes_equal_trimesh(seed, levels):
    vertices, faces = bumpy_sphere(seed)
    expected, _ = trimesh.remesh.subdivide_loop(vertices, faces, iterations=levels)
    refined = refine(Mesh(vertices, faces), loop(), levels).mesh
    assert len(refined.vertices) == len(expected)
    assert match(refined.vertices, expected) < 1e-12


@pytest.mark.parametrize("levels", [1, 2])
def test_open_regular_meshes_equal_libigl(levels):
    vertices, faces = grid(6, bent)
    expected, expected_faces = igl.loop(vertices, faces, levels)
    refined = refine(Mesh(vertices, faces), loop(), levels).mesh
    assert len(refined.vertices) == len(expected)
    assert match(refined.vertices, expected) < 1e-12
    assert len(refined.faces) == len(expected_faces)


@pytest.mark.parametrize("name", ["spot_control_mesh.obj", "penguin_control_mesh.obj"])
def test_real_closed_meshes_equal_trimesh(name):
    mesh = trimesh.load(shared_path(f"assets/{name}"), process=False, force="mesh")
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    expected, _ = trimesh.remesh.subdivide_loop(merged.vertices, merged.faces)
    refined = refine(Mesh(merged.vertices, merged.faces), loop(), 1).mesh
    assert match(refined.vertices, expected) < 1e-12


def test_boundary_follows_the_cubic_curve():
    vertices, faces = grid(5, bent)
    refined = refine(Mesh(vertices, faces), loop(), 1).mesh.vertices
    side = [5 * i for i in range(5)]  # y = −1
    for before, here, after in zip(side, side[1:], side[2:], strict=False):
        expected = vertices[before] / 8 + 3 * vertices[here] / 4 + vertices[after] / 8
        np.testing.assert_allclose(refined[here], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("shape", "vertex", "rule"),
    [(bow_tie, 0, "stays"), (three_pages, 2, "curve"), (three_pages, 0, "stays")],
)
def test_vertices_on_sharp_edges(shape, vertex, rule):
    vertices, faces = shape()
    refined = refine(Mesh(vertices, faces), loop(), 1).mesh.vertices
    expected = vertices[vertex]
    if rule == "curve":
        expected = 3 * vertices[vertex] / 4 + (vertices[0] + vertices[1]) / 8
    np.testing.assert_allclose(refined[vertex], expected, rtol=0, atol=1e-15)


def test_vertex_on_one_irregular_edge_is_a_dart_and_follows_loops_rule():
    """Two tetrahedra that share one edge: its ends lie on one irregular edge and on no other."""
    points = np.random.default_rng(0).standard_normal((6, 3))
    second = np.array([0, 1, 4, 5])[TETRAHEDRON]
    faces = np.concatenate([TETRAHEDRON, second])
    topology = build_topology(faces, len(points))
    sharp = topology.edges[topology.edge_class != EdgeClass.INTERIOR]
    assert sharp.tolist() == [[0, 1]]
    refined = refine(Mesh(points, faces), loop(), 1)
    beta = loop_beta(np.array([5]))[0]
    expected = (1 - 5 * beta) * points[0] + beta * points[1:].sum(axis=0)
    np.testing.assert_allclose(refined.mesh.vertices[0], expected, rtol=0, atol=1e-14)
    assert refined.report["multi_fan_vertices"] == 2


def test_isolated_vertices_stay():
    vertices, faces = grid(3, bent)
    points = np.concatenate([vertices, [[5.0, 6.0, 7.0]]])
    refined = refine(Mesh(points, faces), loop(), 1).mesh.vertices
    np.testing.assert_array_equal(refined[len(vertices)], points[-1])
