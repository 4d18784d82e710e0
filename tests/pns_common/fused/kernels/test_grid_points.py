"""What each kernel of split faces' points writes, as it is compiled and as Python."""

import numpy as np
import pytest

from pns_common.fused.kernels import grid_points as kernels
from tests.support.kernels import WAYS

FACES = np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int32)
VALUES = np.array([[0.0, -0.0], [8, -0.0], [0, -0.0], [8, -0.0]])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_columns_are_taken(dtype, way):
    kernel = kernels.take_columns if dtype is np.int32 else kernels.take_columns_long
    taken = np.full((2, 2), -9, dtype=np.int32)
    WAYS[way](kernel)(FACES.astype(dtype), np.array([2, 0], dtype=np.int32), 1, 2, taken)
    np.testing.assert_array_equal(taken, [[-9, -9], [3, 2]])


@pytest.mark.parametrize("way", WAYS)
def test_points_have_the_vertices_of_their_owners(way):
    owner = np.array([2, 3, 4, 6, 6], dtype=np.int32)
    place = np.zeros((8, 5), dtype=np.int32)
    place[4], place[5] = [0, 0, 0, 0, 1], [0, 1, 1, 0, 1]
    on_edges, ids = 10 * FACES + 10, np.full((2, 5), -9, dtype=np.int32)
    WAYS[way](kernels.number_points)(FACES, on_edges, 60, 2, owner, place, 0, 2, ids)
    # Of both faces the last edge runs backwards, of the second the first one does.
    np.testing.assert_array_equal(ids, [[2, 10, 20, 60, 61], [3, 31, 21, 62, 63]])


@pytest.mark.parametrize("way", WAYS)
def test_labels_move_to_vertices(way):
    labels = np.full(4, -9, dtype=np.int32)
    WAYS[way](kernels.move_to_vertices)(FACES, 5 + FACES, 1, 2, labels)
    np.testing.assert_array_equal(labels, [-9, 6, 7, 8])


@pytest.mark.parametrize("way", WAYS)
def test_values_are_blended_and_no_zero_is_negative_inside(way):
    along, inside = np.full((2, 2), np.nan), np.full((2, 2), np.nan)
    edges = np.array([[0, 2], [0, 1]], dtype=np.int32)
    WAYS[way](kernels.blend_along)(VALUES, edges, np.array([0.25]), 1, 2, along)
    np.testing.assert_array_equal(along, [[np.nan, np.nan], [2, 0]])
    WAYS[way](kernels.blend_inside)(VALUES, FACES, np.array([[0.5, 0.25, 0.25]]), 0, 2, inside)
    np.testing.assert_array_equal(inside, [[2, 0], [4, 0]])
    assert not np.signbit(inside).any()


@pytest.mark.parametrize("way", WAYS)
def test_rows_are_rounded(way):
    rounded = np.full((2, 2), np.nan, dtype=np.float32)
    rows = np.array([0, 1], dtype=np.int32)
    WAYS[way](kernels.round_rows)(np.array([[0.1, 1], [0.2, 2]]), rows, 1, 2, rounded)
    np.testing.assert_array_equal(rounded, np.float32([[np.nan, np.nan], [0.2, 2]]))
