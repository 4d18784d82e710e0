"""Folded children are those that turn too far or all but vanish, told one by one."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology, split
from pns_common.fused.kernels.guard import HELD, find_folds
from pns_common.fused.kernels.together import TOGETHER
from pns_common.fused.levels.loop_points import loop_points
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bent, grid

POINTS, FACES = grid(4, bent)
MESH = edges_built(Mesh(POINTS, FACES))
LOOP = loop_points(POINTS, MESH, Blocks(1))
CHILDREN = split(build_topology(FACES, 16))
COSINE = np.cos(1.0)
NONE = np.zeros(0, dtype=bool)


def areas(points):
    a, b, c = (points[CHILDREN[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def folded(moved):
    before, after = areas(LOOP), areas(moved)
    sizes = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    turned = np.sum(before * after, axis=1) < COSINE * sizes[0] * sizes[1]
    return turned | (sizes[1] < 1e-3 * sizes[0])


def touched(way, displacement, scale, changed, shared=NONE):
    marks = np.zeros(len(LOOP), dtype=bool)
    around = LOOP, displacement, scale, shared, COSINE
    mesh = MESH.faces, MESH.face_edges, MESH.vertex_count
    held = np.zeros(HELD * TOGETHER)
    WAYS[way](find_folds)(*around, *mesh, changed, 0, len(FACES), held, marks)
    return marks


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("size", [0.0, 0.05, 0.2, 50.0])
def test_corners_of_folded_children_are_marked(way, size):
    rng = np.random.default_rng(1)
    displacement, scale = size * rng.standard_normal(LOOP.shape), rng.choice([0, 0.5, 1], len(LOOP))
    bad = folded(LOOP + scale[:, None] * displacement)
    expected = np.zeros(len(LOOP), dtype=bool)
    expected[CHILDREN[bad]] = True
    everywhere = np.zeros(0, dtype=bool)
    # Who has nothing left to give is not asked again.
    marks = touched(way, displacement, scale, everywhere)
    np.testing.assert_array_equal(marks, expected & (scale > 0))
    changed = rng.random(len(LOOP)) < 0.2
    again = np.zeros(len(LOOP), dtype=bool)
    again[CHILDREN[bad & changed[CHILDREN].any(axis=1)]] = True
    marks = touched(way, displacement, scale, changed)
    np.testing.assert_array_equal(marks, again & (scale > 0))
    assert bad.any() == (size >= 0.2)


@pytest.mark.parametrize("way", WAYS)
def test_the_children_of_whoever_changed_are_looked_at_again(way):
    displacement = 50 * np.random.default_rng(2).standard_normal(LOOP.shape)
    bad, unscaled = folded(LOOP + displacement), np.zeros(0)
    for vertex in range(len(LOOP)):
        changed = np.arange(len(LOOP)) == vertex
        expected = np.zeros(len(LOOP), dtype=bool)
        expected[CHILDREN[bad & changed[CHILDREN].any(axis=1)]] = True
        np.testing.assert_array_equal(touched(way, displacement, unscaled, changed), expected)
    nobody = np.zeros(len(LOOP), dtype=bool)
    assert not touched(way, displacement, unscaled, nobody).any()


@pytest.mark.parametrize("way", WAYS)
def test_a_child_that_all_but_vanishes_is_folded(way):
    centre = LOOP[CHILDREN[3]].mean(axis=0)
    displacement = np.zeros_like(LOOP)
    displacement[CHILDREN[3]] = 0.99 * (centre - LOOP[CHILDREN[3]])
    marks = touched(way, displacement, np.ones(len(LOOP)), np.zeros(0, dtype=bool))
    assert marks[CHILDREN[3]].all()
    np.testing.assert_array_equal(touched(way, displacement, np.zeros(0), np.zeros(0, bool)), marks)


@pytest.mark.parametrize("way", WAYS)
def test_shared_corners_are_marked_where_they_fold_a_child_by_themselves(way):
    rng = np.random.default_rng(3)
    displacement, shared = 0.12 * rng.standard_normal(LOOP.shape), rng.random(len(LOOP)) < 0.5
    everywhere, unscaled = np.zeros(0, dtype=bool), np.zeros(0)
    bad = folded(LOOP + displacement)
    by_itself = bad & folded(LOOP + np.where(shared[:, None], displacement, 0.0))
    expected = np.zeros(len(LOOP), dtype=bool)
    expected[CHILDREN[bad]] = True
    expected &= ~shared
    expected[CHILDREN[by_itself]] = True
    corners = shared & np.isin(np.arange(len(LOOP)), CHILDREN[bad])
    assert (expected & corners).any()
    assert (~expected & corners).any()
    marks = touched(way, displacement, unscaled, everywhere, shared)
    np.testing.assert_array_equal(marks, expected)
