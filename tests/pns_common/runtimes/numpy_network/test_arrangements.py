"""Operators that arrange values move each to its place, and know the shape beforehand."""

import numpy as np
import pytest

from pns_common.runtimes.numpy_network.arrangements import ARRANGEMENTS
from pns_common.runtimes.numpy_network.operator import outline_of

TABLE = np.arange(24.0).reshape(4, 6)


def whole(*values):
    return np.array(values)


CASES = {
    "join": ("Concat", [TABLE, TABLE[:1]], {"axis": 0}, [[*TABLE, TABLE[0]]]),
    "pick": ("Gather", [TABLE, whole(5, 0)], {"axis": 1}, [TABLE[:, [5, 0]]]),
    "copy a size": ("Reshape", [TABLE, whole(0, -1, 2)], {}, [TABLE.reshape(4, 3, 2)]),
    "cut": ("Slice", [TABLE, whole(1), whole(3), whole(1)], {}, [TABLE[:, 1:3]]),
    "backwards": (
        *("Slice", [TABLE, whole(9), whole(-99), whole(0), whole(-1)], {}),
        [TABLE[::-1]],
    ),
    "parts": ("Split", [TABLE, whole(1, 3)], {}, [TABLE[:1], TABLE[1:]]),
    "a shorter last part": (
        "Split",
        [TABLE],
        {"num_outputs": 3},
        [TABLE[:2], TABLE[2:], TABLE[4:]],
    ),
    "without an axis": ("Squeeze", [TABLE[None], whole(0)], {}, [TABLE]),
    "with an axis": ("Unsqueeze", [TABLE, whole(1)], {}, [TABLE[:, None]]),
    "turned": ("Transpose", [TABLE], {}, [TABLE.T]),
}


@pytest.mark.parametrize("case", CASES)
def test_values_come_where_they_belong_and_outlines_have_their_shape(case):
    name, inputs, attributes, expected = CASES[case]
    operator = ARRANGEMENTS[name]
    made = operator.compute(inputs, attributes)
    # Sizes, axes and limits are constants: outlines are of all else.
    outlined = [
        each if i in operator.shaping else outline_of(each.shape, each.dtype)
        for i, each in enumerate(inputs)
    ]
    outlines = operator.outline(outlined, attributes)
    for ours, outline, wanted in zip(made, outlines, expected, strict=True):
        np.testing.assert_array_equal(ours, wanted)
        assert (outline.shape, outline.dtype) == (ours.shape, ours.dtype)


@pytest.mark.parametrize(
    ("name", "inputs", "attributes"),
    [
        ("Concat", [TABLE, TABLE[:, :5]], {"axis": 0}),
        ("Gather", [TABLE, TABLE], {}),
        ("Reshape", [TABLE, whole(5, 5)], {}),
        ("Reshape", [TABLE, whole(-1, -1)], {}),
        ("Split", [TABLE, whole(1, 1)], {}),
    ],
)
def test_what_does_not_fit_has_no_outline(name, inputs, attributes):
    with pytest.raises(ValueError, match=r"."):
        ARRANGEMENTS[name].outline(inputs, attributes)
