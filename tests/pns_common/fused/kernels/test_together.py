"""What is held of some edges stands one beside the other, and is what was put there."""

import numpy as np

from pns_common.fused.kernels.together import TOGETHER, keep, kept


def test_vectors_of_neighbours_stand_side_by_side():
    held = np.zeros(7 * TOGETHER)
    for lane in range(TOGETHER):
        keep(held, 4, lane, (lane, -lane, 0.5))
    rows = held.reshape(7, TOGETHER)
    np.testing.assert_array_equal(rows[4], np.arange(TOGETHER))
    np.testing.assert_array_equal(rows[5], -rows[4])
    assert (rows[6] == 0.5).all()
    assert not rows[:4].any()
    assert kept(held, 4, 9) == (9, -9, 0.5)
