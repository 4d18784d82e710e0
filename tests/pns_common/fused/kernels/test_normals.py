"""Angles between children, computed only where they may be the largest: never a wrong one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology, split
from pns_common.fused.kernels.normals import (
    HELD,
    area,
    clearly_less,
    flipped_children,
    largest_jump,
    squared_chord,
    unit_normal,
)
from pns_common.fused.kernels.together import TOGETHER
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bent, grid

POINTS, FACES = grid(4, bent)
MESH = edges_built(Mesh(POINTS, FACES))
CHILDREN = split(build_topology(FACES, 16))
AFTER = build_topology(CHILDREN, 16 + len(MESH.edges))
BEFORE, MOVED = np.random.default_rng(0).standard_normal((2, 16 + len(MESH.edges), 3))


def normals(points):
    a, b, c = (points[CHILDREN[:, i]] for i in range(3))
    made = np.cross(b - a, c - a)
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def chords(pairs):
    n = normals(MOVED)
    return np.sum((n[pairs[:, 0]] - n[pairs[:, 1]]) ** 2, axis=1)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("yet", [0.0, 1.0])
def test_the_largest_jump_is_that_of_all_pairs(way, yet):
    pairs, largest = AFTER.edge_faces[AFTER.interior], np.array([yet])
    edges = MESH.half_edges, MESH.edge_class
    found = WAYS[way](largest_jump)(
        MOVED,
        MESH.faces,
        MESH.face_edges,
        *edges,
        16,
        0,
        len(FACES),
        largest,
        np.zeros(HELD * TOGETHER),
    )
    assert found == pytest.approx(chords(pairs).max(), rel=1e-13) == largest[0]


@pytest.mark.parametrize("way", WAYS)
def test_a_face_looks_inside_and_across_its_edges(way):
    pairs = AFTER.edge_faces[AFTER.interior]
    for f in range(len(FACES)):
        given_ = MOVED, MESH.faces, MESH.face_edges, MESH.half_edges, MESH.edge_class, 16
        found = WAYS[way](largest_jump)(*given_, f, f + 1, np.zeros(1), np.zeros(HELD * TOGETHER))
        assert found == pytest.approx(chords(pairs[(pairs // 4 == f).any(axis=1)]).max(), rel=1e-13)


@pytest.mark.parametrize("way", WAYS)
def test_flipped_children_oppose_their_counterparts(way):
    expected = (np.sum(normals(MOVED) * normals(BEFORE), axis=1) < 0).reshape(-1, 4)
    given_ = MOVED, BEFORE, MESH.faces, MESH.face_edges, 16
    assert WAYS[way](flipped_children)(*given_, 0, len(FACES)) == expected.sum()
    assert WAYS[way](flipped_children)(*given_, 2, 5) == expected[2:5].sum()


def test_a_normal_has_length_one_and_none_without_area():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [1, 0, 0]])
    assert unit_normal(points, 0, 1, 2) == (0, 0, 1)
    assert unit_normal(points, 0, 2, 1) == (0, 0, -1)
    assert unit_normal(points, 0, 1, 3) == (0, 0, 0)
    assert area(*points[:3]) == (0, 0, 6, 36)
    assert squared_chord((0, 0, 1), (0, 0, -1)) == 4
    assert squared_chord((0, 0, 1), (0, 0, 0)) == 0


@given(st.integers(0, 2**31), st.floats(0, 1))
def test_what_is_clearly_less_is_less(seed, bound):
    n, m = np.random.default_rng(seed).standard_normal((2, 3))
    cosine = n @ m / np.linalg.norm(n) / np.linalg.norm(m)
    less = clearly_less((*n, n @ n), (*m, m @ m), bound)
    if abs(cosine**2 - bound) > 1e-12:
        assert less == (cosine > 0 and cosine**2 > bound)
    assert not clearly_less((*n, n @ n), (0, 0, 0, 0), bound)
