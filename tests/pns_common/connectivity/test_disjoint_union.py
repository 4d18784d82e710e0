"""A union's faces are those of its parts, over vertices of their own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.disjoint_union import disjoint_faces


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(0, 6)), min_size=1, max_size=5))
def test_every_part_keeps_its_points_and_no_two_share_one(sizes):
    rng = np.random.default_rng(0)
    parts = [(rng.integers(0, vertices, (faces, 3)), vertices) for vertices, faces in sizes]
    points = [rng.normal(size=(vertices, 3)) for vertices, _ in sizes]
    faces = disjoint_faces(parts)
    assert faces.dtype == np.int64
    expected = [own[corners] for own, (corners, _) in zip(points, parts, strict=True)]
    np.testing.assert_array_equal(np.concatenate(points)[faces], np.concatenate(expected))
    owner = np.repeat(np.arange(len(sizes)), [vertices for vertices, _ in sizes])
    assert (owner[faces] == owner[faces[:, :1]]).all()


@pytest.mark.parametrize("narrow", [np.uint8, np.int32])
def test_narrow_indices_do_not_wrap(narrow):
    part = np.array([[0, 1, 2]], dtype=narrow)
    assert disjoint_faces([(part, 2**31), (part, 3)])[1].tolist() == [2**31, 2**31 + 1, 2**31 + 2]
