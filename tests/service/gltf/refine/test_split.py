"""Splits of kept faces: copies meet their faces, names stay those of nearest corners."""

import numpy as np
import pytest

from pns_common import Creases
from pns_common.carry.descendants import copied_corners, corner_weights, cut_quads
from pns_common.schemes import CATMULL_CLARK, LOOP
from service.gltf.refine.split import WholeLevels

FACES = np.array([[0, 1, 2], [2, 1, 3], [3, 4, 2], [5, 2, 0], [2, 5, 6], [1, 2, 7]])


def split(faces, levels, base=LOOP):
    corners = faces.reshape(-1)
    offsets = np.arange(0, len(corners) + 1, faces.shape[1])
    whole = WholeLevels(base, levels, offsets, np.zeros(len(corners) * 4**levels, dtype=np.int64))
    return whole, whole.rows(corners)


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 1, 0), (0, 2, 1), (0, 3, 2, 1)])
def test_a_copy_has_the_corners_of_its_face(order):
    degree, levels = len(order), 2
    values = np.random.default_rng(0).random((degree, 3))
    weights = corner_weights(degree, levels)
    there, copy = weights @ values, weights @ values[list(order)]
    np.testing.assert_allclose(there[copied_corners(order, levels)], copy, atol=1e-15)


@pytest.mark.parametrize("levels", [0, 1, 3])
def test_the_triangles_of_quads_cover_the_square_once(levels):
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points = (corner_weights(4, levels) @ square)[cut_quads(levels)]
    areas = np.linalg.det(points[:, 1:] - points[:, :1]) / 2
    np.testing.assert_allclose(areas, np.full(2 * 4**levels, 1 / (2 * 4**levels)))


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize(
    ("base", "faces"), [(LOOP, FACES), (CATMULL_CLARK, np.array([[0, 1, 2, 3], [3, 2, 4, 5]]))]
)
def test_nearest_is_a_corner_of_the_largest_weight(base, faces, levels):
    count = int(faces.max()) + 1
    _, rows = split(faces, levels, base)
    # One column a corner: linear gives each refined row its share of every corner.
    share = rows.values.linear(np.eye(count))
    nearest = rows.values.nearest(np.arange(count)[:, None])[:, 0]
    np.testing.assert_array_equal(share[np.arange(len(share)), nearest], share.max(axis=1))
    np.testing.assert_array_equal(nearest[:count], np.arange(count))


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_creases_of_charts_are_found_whatever_the_type_and_size_of_their_names(dtype):
    # A fan of four faces around corner 0; vertices are numbered beyond √2³¹, the largest elsewhere.
    whole, rows = split(np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]), 1)
    vertex, uv = 50_000 + np.arange(5), np.random.default_rng(0).random((5, 2))
    named = np.array([[50_000, 50_001], [50_003, 50_000], [60_000, 60_001]], dtype=dtype)
    smooth = whole.smooth(rows, vertex, Creases(), uv, limit=False)
    sharp = whole.smooth(rows, vertex, Creases(named), uv, limit=False)
    # On a crease a vertex follows its two neighbours along it: 3/4, and 1/8 of each.
    np.testing.assert_allclose(sharp[0], 3 / 4 * uv[0] + (uv[1] + uv[3]) / 8, atol=1e-15)
    assert np.abs(smooth[0] - sharp[0]).max() > 1e-3
