"""Kernels are compiled for arrays that numpy lays out: entries read where numpy keeps things."""

import ctypes
import re

import numpy as np
import pytest

pytest.importorskip("numba")

from pns_common.fused.compiler import DATA, SHAPE, STRIDES, _compiled, _entry, _helpers, _type
from pns_common.fused.kernels import edges, masks
from pns_common.fused.kernels.compiled import INDICES, INTEGERS_2, POINTS, POINTS_OUT, SIZE, Kernel
from pns_common.fused.kernels.masks import largest_coordinate, sum_rings


def word_at(address):
    return ctypes.c_ssize_t.from_address(address).value


def test_an_array_keeps_its_data_shape_and_strides_where_entries_read_them():
    array = np.arange(60.0).reshape(10, 6)[:, :3].copy()
    head = id(array)
    assert word_at(head + DATA) == array.ctypes.data
    for offset, expected in ((SHAPE, array.shape), (STRIDES, array.strides)):
        first = word_at(head + offset)
        assert (word_at(first), word_at(first + 8)) == expected


def test_an_entry_takes_each_array_as_one_pointer_and_passes_it_as_numbers():
    text = _entry(largest_coordinate, "inner")
    assert 'define double @"masks.largest_coordinate"(ptr %a0, i64 %a1, i64 %a2) {' in text
    passed = text[text.index('@"inner"(') :].splitlines()[0]
    # Two results; of the array two owners, two sizes, data, two of shape, two of strides.
    assert passed.count(",") + 1 == 2 + 9 + 2


def test_only_what_is_written_is_writable():
    assert not _type(POINTS).mutable
    assert _type(POINTS_OUT).mutable
    assert str(_type(SIZE)) == "int64"


def test_helpers_are_the_plain_functions_of_a_module_and_no_kernel_or_import():
    names = {helper.__name__ for helper in _helpers([masks, edges])}
    assert {"opposite", "_repeats", "_may_repeat"} <= names
    assert not names & {"sum_rings", "kernel"}
    assert sum_rings.function not in _helpers([masks])


def test_statements_that_do_the_same_to_a_row_are_vectors_only_where_it_is_asked_for():
    def divide(rows):
        for k in range(4):
            rows[0, k] = rows[0, k] / 3
        return 0

    for by_rows in (False, True):
        code = str(_compiled(Kernel(divide, SIZE, (POINTS_OUT,), by_rows=by_rows)))
        assert bool(re.search(r"fdiv <\d+ x double>", code)) == by_rows


def test_what_is_never_negative_is_read_without_a_sign():
    assert [str(_type(each).dtype) for each in (INDICES, INTEGERS_2)] == ["uint32", "int32"]
