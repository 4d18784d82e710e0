"""What an edge sees, by the plain formula one edge at a time."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.edge_features import HELD, look
from pns_common.fused.kernels.together import TOGETHER
from tests.support import plain_operator
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere

POINTS, FACES = bumpy_sphere(9, subdivisions=0, bump=0.3)
MESH, PLAIN = edges_built(Mesh(POINTS, FACES)), plain_operator.PlainMesh(POINTS, FACES)
COUNT, PAIRS = 30, MESH.edges.tolist()
NORMALS = np.array([plain_operator.unit(PLAIN.area(*face)) for face in FACES])
FIELDS = np.column_stack([PLAIN.mean_normal, PLAIN.height])
BENDS = np.linspace(0, 1, len(FACES))
FRAMES = np.array([np.concatenate(PLAIN.frame(a, b)) for a, b in PAIRS])
LENGTH = np.array([PLAIN.length(a, b, None) for a, b in PAIRS])
STENCILS = build_topology(FACES, len(POINTS)).stencil


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
