"""What an edge sees and gets, by the plain formula one edge at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.edge_correction import (
    HELD,
    correct,
    correct_scale_free,
    in_ball,
    look,
    shortened,
)
from pns_common.fused.kernels.together import TOGETHER
from tests.support import plain_operator
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere

POINTS, FACES = bumpy_sphere(9, subdivisions=0, bump=0.3)
MESH, PLAIN = edges_built(Mesh(POINTS, FACES)), plain_operator.PlainMesh(POINTS, FACES)
COUNT, RNG = 30, np.random.default_rng(0)
PAIRS = MESH.edges.tolist()
NORMALS = np.array([plain_operator.unit(PLAIN.area(*face)) for face in FACES])
FIELDS = np.column_stack([PLAIN.mean_normal, PLAIN.height])
BENDS = np.linspace(0, 1, len(FACES))
FRAMES = np.array([np.concatenate(PLAIN.frame(a, b)) for a, b in PAIRS])
LENGTH = np.array([PLAIN.length(a, b, None) for a, b in PAIRS])
STENCILS = build_topology(FACES, len(POINTS)).stencil.astype(np.int32)
Z, GATE = RNG.standard_normal((COUNT, 3)), RNG.random(COUNT)
PER_LENGTH = RNG.uniform(0.1, 0.5, COUNT)


def read(measures, mesh):
    connectivity = mesh.faces, mesh.edges, mesh.face_edges, mesh.half_edges, mesh.interior
    return [each.reshape(-1) for each in (*measures, *connectivity)]


def looked(way, width, begin=0, end=COUNT):
    n = end - begin
    frame, features = np.empty((n, 9)), np.zeros((n, width))
    h, longest, x = np.empty(n), np.empty(n), np.empty(n)
    degenerate = np.ones(n, dtype=bool)
    gentlest, around = np.empty(n), (POINTS, NORMALS, FIELDS, BENDS, LENGTH, np.log(LENGTH))
    stencils = np.empty((n, 4), dtype=np.int32)
    out = stencils.reshape(-1), frame.reshape(-1), h, longest, x, degenerate, features, gentlest
    held = np.zeros(HELD * TOGETHER)
    WAYS[way](look)(*read(around, MESH), begin, end, 1, *out, held)
    np.testing.assert_array_equal(gentlest, BENDS[MESH.half_edges[begin:end] // 3].min(axis=1))
    np.testing.assert_array_equal(stencils[:, :2], STENCILS[begin:end, :2])
    np.testing.assert_array_equal(np.sort(stencils), np.sort(STENCILS[begin:end]))
    assert not degenerate.any()
    return frame, h, longest, x, features


@pytest.mark.parametrize("way", WAYS)
def test_frames_lengths_and_features(way):
    frame, h, longest, x, features = looked(way, 18)
    np.testing.assert_allclose(frame, FRAMES, atol=1e-13)
    np.testing.assert_allclose(h, LENGTH, rtol=1e-15)
    np.testing.assert_allclose(longest, [PLAIN.longest_side(a, b) for a, b in PAIRS])
    np.testing.assert_allclose(x, [PLAIN.jump(a, b) for a, b in PAIRS], atol=1e-14)
    np.testing.assert_allclose(features, [PLAIN.edge_features(a, b) for a, b in PAIRS], atol=1e-13)
    for width in (5, 14):
        np.testing.assert_array_equal(looked(way, width)[4], features[:, :width])
    np.testing.assert_array_equal(looked(way, 18, 7, 11)[4], features[7:11])


@pytest.mark.parametrize("way", WAYS)
def test_antiparallel_faces_have_the_worlds_axes_and_shut_only_where_reading_is_symmetric(way):
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [1, 1, 0]])
    folded = edges_built(Mesh(points, np.array([[0, 1, 2], [1, 0, 3]])))
    normals = np.array([[0.0, 0, 1], [0, 0, -1]])
    for symmetric, curvature in ((0, 2.0), (1, 0.0)):
        frame, features = np.empty((1, 9)), np.zeros((1, 5))
        h, longest, x = np.empty(1), np.empty(1), np.empty(1)
        degenerate = np.zeros(1, dtype=bool)
        around = points, normals, np.zeros((0, 4)), np.zeros(0), np.ones(5), np.zeros(5)
        out = np.empty(4, dtype=np.int32), frame.reshape(-1), h, longest, x, degenerate, features
        rest = np.zeros(0), np.zeros(HELD * TOGETHER)
        WAYS[way](look)(*read(around, folded), 0, 1, symmetric, *out, *rest)
        np.testing.assert_array_equal(frame.reshape(3, 3), np.eye(3))
        assert (bool(degenerate[0]), x[0], features[0, 0]) == (True, curvature, curvature)


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
