"""What a learned level adds: rows to write into or to clear, views of some, and a scale."""

import numpy as np

from pns_common.base.blocks import Blocks
from pns_common.fused.levels.additions import Additions


def nothing(count):
    added = Additions.unwritten(count)
    for values in (added.displacement, added.ratio, added.gate, added.envelope):
        values[:] = np.nan
    added.clear()
    return added


def test_some_rows_are_views_of_the_whole_and_others_copies():
    added = nothing(5)
    added.rows(slice(3, None)).displacement[:] = [1, 2, 3]
    added.rows(slice(0, 2)).gate[:] = 0.5
    added.rows(np.array([0, 1])).envelope[:] = 7
    assert added.rows(slice(None)).corrected is None
    assert not added.envelope.any()
    assert added.displacement.tolist() == [[0, 0, 0]] * 3 + [[1, 2, 3]] * 2
    assert added.gate.tolist() == [0.5, 0.5, 0, 0, 0]


def test_rows_are_cleared_by_their_numbers():
    added = Additions.unwritten(40)
    for values in (added.displacement, added.ratio, added.gate, added.envelope):
        values[:] = 4.0
    rows = np.random.default_rng(0).permutation(40)[:17].astype(np.int32)
    added.clear_rows(rows, Blocks(2, 5))
    for values in (added.displacement, added.ratio, added.gate, added.envelope):
        expected = np.full_like(values, 4.0)
        expected[rows] = 0
        np.testing.assert_array_equal(values, expected)


def test_a_scale_is_of_the_displacement_and_of_its_share_of_the_bound_alone():
    added = nothing(2)
    for values in (added.displacement, added.ratio, added.gate, added.envelope):
        values[:] = 4.0
    added.scale(np.array([0.5, 0.0]))
    assert added.displacement.tolist() == [[2, 2, 2], [0, 0, 0]]
    assert added.ratio.tolist() == [2, 0]
    assert added.gate.tolist() == added.envelope.tolist() == [4, 4]


def test_what_is_forgotten_has_no_rows_and_the_rest_stays():
    left = nothing(3).forgotten()
    assert left.displacement.shape == (0, 3)
    assert left.envelope.shape == (0,)
    assert left.displacement.base is None
    assert left.rows(slice(1, None)).gate.tolist() == [0, 0]
