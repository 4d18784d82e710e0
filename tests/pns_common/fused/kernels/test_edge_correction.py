"""What an edge gets, by the plain formula one edge at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.edge_correction import (
    correct,
    correct_scale_free,
    in_ball,
    shortened,
)
from tests.support import plain_operator
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere

POINTS, FACES = bumpy_sphere(9, subdivisions=0, bump=0.3)
MESH, PLAIN = edges_built(Mesh(POINTS, FACES)), plain_operator.PlainMesh(POINTS, FACES)
COUNT, RNG = 30, np.random.default_rng(0)
PAIRS = MESH.edges.tolist()
FRAMES = np.array([np.concatenate(PLAIN.frame(a, b)) for a, b in PAIRS])
LENGTH = np.array([PLAIN.length(a, b, None) for a, b in PAIRS])
STENCILS = build_topology(FACES, len(POINTS)).stencil.astype(np.int32)
Z, GATE = RNG.standard_normal((COUNT, 3)), RNG.random(COUNT)
PER_LENGTH = RNG.uniform(0.1, 0.5, COUNT)


def outputs():
    return np.zeros((COUNT, 3)), np.zeros(COUNT), np.zeros(COUNT), np.zeros(COUNT)


@pytest.mark.parametrize("way", WAYS)
def test_the_papers_correction(way):
    delta, ratio, gate, envelope = out = outputs()
    WAYS[way](correct)(MESH.interior, 0, COUNT, *out, Z, FRAMES, LENGTH, GATE, PER_LENGTH)
    for e in range(COUNT):
        bound = PER_LENGTH[e] * LENGTH[e] ** 2
        local = plain_operator.shortened(Z[e], 1)
        expected = GATE[e] * bound * FRAMES[e].reshape(3, 3).T @ local
        np.testing.assert_allclose(delta[e], expected, atol=1e-15)
        assert envelope[e] == pytest.approx(bound)
        assert ratio[e] == pytest.approx(np.linalg.norm(expected) / bound)
    np.testing.assert_array_equal(gate, GATE)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("boundary", [False, True])
def test_the_scale_free_correction(way, boundary):
    pushes, rim = 0.05 * RNG.standard_normal((2, 12, 3))
    of_curves = rim if boundary else np.zeros((0, 3))
    delta, ratio, _, envelope = out = outputs()
    strengths = RNG.uniform(0.5, 1.5, COUNT)
    wanted = 0.9 * LENGTH, pushes, of_curves, 0.0, 0.4
    answer = Z, FRAMES, 1.1 * LENGTH, GATE, PER_LENGTH, STENCILS, strengths
    WAYS[way](correct_scale_free)(*wanted, MESH.interior, 0, COUNT, *out, *answer)
    for e, (a, b) in enumerate(PAIRS):
        local = plain_operator.shortened(Z[e], 1)
        asked = 0.4 * 0.9 * LENGTH[e] * FRAMES[e].reshape(3, 3).T @ local
        of_rings = strengths[e] * PLAIN.loop_edge(a, b, pushes)
        prior = of_rings + boundary * PLAIN.loop_edge(a, b, rim)
        bound = PER_LENGTH[e] * (1.1 * LENGTH[e]) ** 2
        expected = GATE[e] * plain_operator.shortened(prior + asked, bound)
        np.testing.assert_allclose(delta[e], expected, atol=1e-15)
        assert envelope[e] == pytest.approx(bound)
        assert ratio[e] == pytest.approx(np.linalg.norm(expected) / bound)


def test_vectors_are_shortened_and_never_lengthened():
    assert in_ball((0.3, 0.0, 0.4)) == (0.3, 0.0, 0.4)
    np.testing.assert_allclose(in_ball((3e200, 0.0, -4e200)), (0.6, 0, -0.8))
    assert shortened((3.0, 0.0, 4.0), 10.0) == (3, 0, 4)
    np.testing.assert_allclose(shortened((3.0, 0.0, 4.0), 1.0), (0.6, 0, 0.8))
    assert shortened((3.0, 0.0, 4.0), 0.0) == (0, 0, 0)
    assert shortened((3.0, 0.0, 4.0), 5.0) == (3, 0, 4)
    # Also by less than squares of this size can tell.
    assert shortened((3e-160, 0.0, 4e-160), 4.9999719e-160)[2] < 4e-160
