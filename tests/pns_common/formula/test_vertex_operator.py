"""The vertex operator: its formula, shortened to its bound, and the same on both backends."""

from dataclasses import replace

import numpy as np
import torch
from hypothesis import given

from pns_common.connectivity.topology import build_topology
from pns_common.features.ring_features import RING_10
from pns_common.formula.vertex_operator import VertexOperator
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings
from pns_common.rules.control_level import control_level
from tests.support.meshes import bumpy_sphere, manifolds, soups
from tests.support.plain_operator import PlainMesh, shortened

OPERATOR = VertexOperator(RING_10, lambda rows: 0.2 * rows[:, :3], 2.0)


@given(soups() | manifolds())
def test_numpy_and_torch_agree(mesh):
    weights = np.random.default_rng(0).standard_normal((RING_10.count, 3))
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = np.flatnonzero(topology.smooth_vertices)

    def step(points, xp):
        tensor = xp.asarray(weights)
        operator = replace(OPERATOR, network=lambda f: xp.tanh(f @ tensor))
        normals = face_normals(points, topology.faces)
        result = operator.correct(Rings(topology, points, normals), rows, 0.5)
        return result.displacement, result.gate

    ours, theirs = step(mesh.vertices, np), step(torch.tensor(mesh.vertices), torch)
    scale = max(1.0, np.abs(mesh.vertices).max()) ** 2
    for own, twin in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(own, twin.numpy(), rtol=1e-10, atol=1e-12 * scale)


def test_torch_differentiates_through_the_vertex_rule():
    vertices, faces = bumpy_sphere(0, subdivisions=0)
    topology = build_topology(faces, len(vertices))
    rows = np.arange(len(vertices))
    weights = torch.from_numpy(np.random.default_rng(0).standard_normal((RING_10.count, 3)))
    operator = replace(OPERATOR, network=lambda f: torch.tanh(f @ weights))

    def displacement(points):
        normals = face_normals(points, topology.faces)
        return operator.correct(Rings(topology, points, normals), rows, 0.5).displacement

    points = torch.tensor(vertices, requires_grad=True)
    assert torch.autograd.gradcheck(displacement, (points,), fast_mode=True)


def test_a_correction_is_the_formula_of_all_its_parts():
    points, faces = bumpy_sphere(7, subdivisions=0, bump=0.3)
    plain, rows = PlainMesh(points, faces), np.array([3, 0, 11])
    rings = control_level(points, build_topology(faces, len(points))).rings
    prior, asked = 0.02 * points[:3], np.array([[0.3], [0.1], [2.0]])
    learned = OPERATOR.correct(rings, rows, 1 / 5)
    scale_free = OPERATOR.correct_scale_free(rings, rows, 1 / 5, asked, prior)
    for row, v in enumerate(rows):
        z = shortened(0.2 * np.array(plain.ring_features(v)[:3]), 1)
        combined = z @ np.array(plain.ring_vectors(v))
        gate, bound = np.tanh(2 * plain.mean_jump[v]), plain.spoke_length(v) ** 2 / 5
        expected = gate * bound * shortened(combined, 1)
        np.testing.assert_allclose(learned.displacement[row], expected, atol=1e-15)
        wanted = prior[row] + asked[row] * combined
        expected = gate * shortened(wanted, bound)
        np.testing.assert_allclose(scale_free.displacement[row], expected, atol=1e-15)
        for made in (learned, scale_free):
            np.testing.assert_allclose([made.gate[row], made.envelope[row]], [gate, bound])
    assert not learned.degenerate.any()
