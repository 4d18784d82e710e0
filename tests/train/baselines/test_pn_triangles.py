import numpy as np

from pns_common import Mesh, refine
from pns_common.connectivity.topology import build_topology
from tests.support.meshes import icosphere
from train.baselines.pn_triangles import cubic_control_point, pn_triangles


def test_edge_curves_leave_a_sphere_tangentially():
    """At both ends the cubic has the sphere's normal."""
    vertices, faces = icosphere(0)
    a, b = vertices[build_topology(faces, len(vertices)).edges].transpose(1, 0, 2)
    control = cubic_control_point(a, b, a)
    np.testing.assert_allclose(((control - a) * a).sum(axis=1), 0, atol=1e-15)


def test_edge_vertices_over_a_sphere_have_the_closed_form_radius():
    """2 cos(t/2) (5 − cos t) / 8 for an edge of angle t: the cubic at ½, with exact normals."""
    vertices, faces = icosphere(0)
    cosine = 1 / np.sqrt(5)
    half = np.sqrt((1 + cosine) / 2)
    refined = refine(Mesh(vertices, faces), pn_triangles(), 1, threads=1).mesh.vertices
    radius = np.linalg.norm(refined[len(vertices) :], axis=1)
    np.testing.assert_allclose(radius, 2 * half * (5 - cosine) / 8, atol=1e-14)
    assert abs(radius[0] - 1) < abs(half - 1) / 4


def test_a_cubic_curve_along_a_straight_edge_with_upright_normals_is_the_midpoint():
    start, end = np.array([[0.0, 0, 0]]), np.array([[3.0, 0, 0]])
    up = np.array([[0.0, 0, 1]])
    np.testing.assert_allclose(cubic_control_point(start, end, up), [[1, 0, 0]])
    np.testing.assert_allclose(cubic_control_point(end, start, up), [[2, 0, 0]])
