"""Array helpers, in numpy and torch, against plain loops and numpy's own functions."""

import numpy as np
import pytest
import torch

from pns_common.base import arrays

KINDS = {"numpy": np.asarray, "torch": torch.as_tensor}
RNG = np.random.default_rng(0)
ROWS, OTHERS = RNG.standard_normal((2, 7, 3))


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


def test_rows_are_gathered_in_the_shape_of_the_indices(kind):
    indices = np.array([[6, 0], [3, 3]])
    gathered = arrays.as_numpy(arrays.gather(kind(ROWS), indices))
    np.testing.assert_array_equal(gathered, ROWS[indices])
    # torch looks at no memory that runs backwards or may not be written.
    backwards = np.arange(7)[::-1]
    backwards.flags.writeable = False
    np.testing.assert_array_equal(arrays.gather(kind(ROWS), backwards), ROWS[::-1])


def test_segments_are_summed_in_the_order_of_their_rows(kind):
    segments = np.array([2, 0, 2, 2, 0, 4, 2])
    expected = np.zeros((5, 3))
    for row, segment in zip(ROWS, segments, strict=True):
        expected[segment] += row
    np.testing.assert_array_equal(arrays.segment_sum(kind(ROWS), segments, 5), expected)


def test_scattered_rows_stand_where_they_are_sent_and_all_others_are_0(kind):
    places = np.array([5, 0, 8, 1, 2, 9, 3])
    spread = arrays.as_numpy(arrays.scatter(kind(ROWS), places, 10))
    np.testing.assert_array_equal(spread[places], ROWS)
    assert not spread[[4, 6, 7]].any()


def test_products_and_lengths_are_numpys(kind):
    u, v = kind(ROWS), kind(OTHERS)
    np.testing.assert_allclose(arrays.dot(u, v), np.sum(ROWS * OTHERS, axis=1), rtol=1e-14)
    every = arrays.as_numpy(arrays.dot(u[:, None], v[None]))
    np.testing.assert_allclose(every, ROWS @ OTHERS.T, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(arrays.cross(u, v), np.cross(ROWS, OTHERS), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(arrays.norm(u), np.linalg.norm(ROWS, axis=1), rtol=1e-15)


def test_unit_rows_are_exact_on_an_axis_and_short_ones_become_0(kind):
    rows = kind(np.array([[0, 0, -0.3], [0, 0, 0], [3e-5, 4e-5, 0]]))
    unit = arrays.as_numpy(arrays.unit(rows))
    np.testing.assert_array_equal(unit[:2], [[0, 0, -1], [0, 0, 0]])
    np.testing.assert_allclose(unit[2], [0.6, 0.8, 0], rtol=1e-15)
    assert not arrays.as_numpy(arrays.unit_longer_than(rows, 1e-4))[2].any()


def test_the_length_of_nothing_has_gradient_0():
    rows = torch.zeros((1, 3), requires_grad=True)
    arrays.norm(rows).sum().backward()
    assert not rows.grad.any()
    assert not arrays.detached(rows).requires_grad
