"""Points of split faces, on two faces whose edges have one point each."""

import numpy as np
import pytest

from pns_common.carry import grid
from pns_common.parallel import Blocks

# Points in the order corner 0, 1, 2, then the middles of edges (a, b), (b, c), (c, a), then one
# inside. An edge's only point is the same from both ends.
OWNER = np.arange(7)
PLACE = np.zeros((8, 7), dtype=np.int64)
FACES, EDGES = np.array([[0, 1, 2], [2, 1, 3]]), np.array([[0, 1], [1, 2], [0, 2], [1, 3], [2, 3]])
ON_EDGES = 4 + np.array([[0, 1, 2], [1, 3, 4]])
IDS = np.array([[0, 1, 2, 4, 5, 6, 9], [2, 1, 3, 5, 7, 8, 10]])
BLOCKS = Blocks(threads=2, rows=1)


def test_corners_come_first_then_edges_then_what_is_inside():
    ids = grid.number_points(FACES, ON_EDGES, 9, OWNER, PLACE, BLOCKS)
    assert ids.dtype == np.int32
    np.testing.assert_array_equal(ids, IDS)


def test_points_of_an_edge_are_counted_from_its_lower_corner():
    # Two points on the edge (a, b) alone, which the second face has from the higher corner on; both
    # faces have the edge (c, a) so.
    owner, place = np.array([3, 3]), np.zeros((8, 2), dtype=np.int64)
    place[4], place[5] = [0, 1], [1, 0]
    corners, on_edges = np.array([[0, 1, 2], [1, 0, 3]]), np.array([[4, 6, 8], [4, 8, 6]])
    ids = grid.number_points(corners, on_edges, 9, owner, place, BLOCKS)
    np.testing.assert_array_equal(ids, [[4, 5], [5, 4]])


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_labels_move_to_the_vertices_of_their_points(dtype):
    moved = grid.move_to_vertices(IDS, 100 + IDS.astype(dtype), 11, BLOCKS)
    assert moved.dtype == dtype
    np.testing.assert_array_equal(moved[np.unique(IDS)], 100 + np.unique(IDS))


def test_columns_are_taken_in_the_type_that_is_asked_for():
    taken = grid.take_points(IDS, np.array([6, 0, 0]), np.int32, BLOCKS)
    assert taken.dtype == np.int32
    np.testing.assert_array_equal(taken, [[9, 0, 0], [10, 2, 2]])


def test_values_lie_between_those_of_corners():
    values = np.array([[0.0, 0], [8, 0], [0, 8], [8, 8]])
    along, inside = np.empty((10, 2)), np.empty((2, 2))
    grid.blend_along(values, EDGES, np.array([0.25, 0.5]), along, BLOCKS)
    np.testing.assert_array_equal(along[:4], [[2, 0], [4, 0], [6, 2], [4, 4]])
    grid.blend_inside(values, FACES, np.array([[0.5, 0.25, 0.25]]), inside, BLOCKS)
    np.testing.assert_array_equal(inside, [[2, 2], [4, 6]])


def test_rows_are_rounded_once():
    values = np.array([[1 + 2.0**-30, 0, 0], [0.1, 0.2, 0.3]])
    rows = grid.rounded_rows(values, np.array([1, 0, 1]), BLOCKS)
    assert rows.dtype == np.float32
    np.testing.assert_array_equal(rows, np.float32([[0.1, 0.2, 0.3], [1, 0, 0], [0.1, 0.2, 0.3]]))


def test_indices_are_as_narrow_as_they_may_be():
    assert grid.index_type(2**31 - 1) is np.int32
    assert grid.index_type(2**31) is np.int64
