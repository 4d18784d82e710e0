"""What is measured of rings: as defined, within its ranges, with gradients everywhere."""

import numpy as np
import torch
from hypothesis import given

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings, ring_vectors
from pns_common.rules.control_level import control_level
from tests.support.meshes import bumpy_sphere, grid, manifolds, soups
from tests.support.plain_operator import PlainMesh

ROUNDING = 1 + 1e-12


@given(soups() | manifolds())
def test_vectors_keep_their_length(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rings = Rings(topology, mesh.vertices, face_normals(mesh.vertices, mesh.faces))
    assert np.linalg.norm(ring_vectors(rings), axis=2).max() <= ROUNDING


@given(soups())
def test_gradients_are_finite_on_degenerate_meshes(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    points = torch.tensor(mesh.vertices / np.abs(mesh.vertices).max(), requires_grad=True)
    rings = Rings(topology, points, face_normals(points, topology.faces))
    ring_vectors(rings).sum().backward()
    assert torch.isfinite(points.grad).all()


def test_each_quantity_is_as_it_is_defined():
    points, faces = bumpy_sphere(5, subdivisions=0)
    plain, vertices = PlainMesh(points, faces), range(len(points))
    rings = control_level(points, build_topology(faces, len(points))).rings
    by_definition = {
        "normal": plain.mean_normal,
        "umbrella": [plain.umbrella(v) for v in vertices],
        "spoke_length": [[plain.spoke_length(v)] for v in vertices],
        "square": [[plain.spoke_length(v) ** 2] for v in vertices],
        "mean_jump": [[x] for x in plain.mean_jump],
        "height": [[k] for k in plain.height],
        "edge_squares": [plain.length(a, b, None) ** 2 for a, b in rings.topology.edges.tolist()],
        "edge_jumps": [plain.jump(a, b) for a, b in rings.topology.edges.tolist()],
        "double_areas": [np.linalg.norm(plain.area(*face)) for face in faces],
    }
    for name, expected in by_definition.items():
        np.testing.assert_allclose(getattr(rings, name), expected, atol=1e-13, err_msg=name)
    vectors = [plain.ring_vectors(v) for v in vertices]
    np.testing.assert_allclose(ring_vectors(rings), vectors, atol=1e-13)


def test_both_spokes_of_an_edge_have_its_bend_and_values_of_their_ends():
    points, faces = grid(3, lambda x, y: x**2)
    rings = control_level(points, build_topology(faces, 9)).rings
    for values in (rings.jump, rings.bend):
        np.testing.assert_array_equal(values[::2], values[1::2])
        assert not values[::2][rings.topology.edge_class != 0].any()
    number = np.arange(9.0)[:, None]
    ends = rings.topology.edges
    np.testing.assert_array_equal(rings.of_centre(number).reshape(-1, 2), ends)
    np.testing.assert_array_equal(rings.of_neighbour(number).reshape(-1, 2), ends[:, ::-1])
    at_edges = np.arange(len(ends)) ** 2.0
    expected = [at_edges[(ends == v).any(axis=1)].mean() for v in range(9)]
    np.testing.assert_allclose(rings.mean_of_edges(at_edges)[:, 0], expected)


def test_an_open_ring_leans_to_no_side():
    points, faces = grid(4, lambda x, y: x * y)
    heights = control_level(points, build_topology(faces, 16)).rings.height[:, 0]
    assert set(np.flatnonzero(heights)) <= {5, 6, 9, 10}
