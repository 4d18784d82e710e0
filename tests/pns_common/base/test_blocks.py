"""Blocks of rows on several threads: each block once, whichever thread comes to it."""

import itertools
import sys
import time

import numpy as np
import pytest

from pns_common.base.blocks import Blocks, available_threads


@pytest.fixture
def hasty():
    """Threads that take turns after every few instructions."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_threads_in_haste_take_each_block_once(hasty):
    for _ in range(3):
        taken = []
        Blocks(threads=4, rows=1).run(5000, taken.append)
        assert sorted(rows.start for rows in taken) == list(range(5000))


@pytest.mark.parametrize(("count", "rows"), [(0, 5), (3, 5), (5, 5), (11, 5), (41, 30)])
@pytest.mark.parametrize("least", [None, 2])
@pytest.mark.parametrize("threads", [1, 4, 12])
def test_blocks_cover_all_rows_and_are_counted(count, rows, least, threads):
    taken = []
    blocks = Blocks(threads, rows, least=least)
    blocks.run(count, taken.append)
    taken.sort(key=lambda part: part.start)
    assert [row for part in taken for row in range(part.start, part.stop)] == list(range(count))
    assert len(taken) == blocks.count(count)
    assert [blocks.number(part, count) for part in taken] == list(range(len(taken)))


def test_little_work_is_divided_among_all_threads_but_not_into_crumbs():
    blocks = Blocks(threads=3, rows=100, least=4)
    assert [blocks.rows_of(count) for count in (0, 10, 60, 61, 599, 10_000)] == [
        1,
        5,
        10,
        11,
        100,
        100,
    ]


def test_blocks_are_even_so_that_no_thread_waits_for_a_long_one():
    blocks = Blocks(threads=2, rows=100)
    assert [blocks.rows_of(count) for count in (1, 100, 101, 250)] == [1, 100, 51, 84]


class StopRefiningError(Exception):
    """Nobody wants it."""


def test_an_error_in_a_block_reaches_the_caller():
    def fail(rows):
        raise ValueError(f"rows {rows.start}")

    with pytest.raises(ValueError, match="rows"):
        Blocks(threads=2, rows=3).run(10, fail)
    assert available_threads() >= 1


@pytest.mark.parametrize("threads", [1, 3])
def test_after_an_error_no_more_blocks_are_begun(threads):
    begun, number = [], itertools.count()

    def refuse_the_first(count):
        begun.append(count)
        if next(number) == 0:
            raise StopRefiningError
        time.sleep(1e-3)  # the other threads go on

    with pytest.raises(StopRefiningError):
        Blocks(threads, 1, refuse_the_first).run(10_000, lambda rows: None)
    assert len(begun) < 5_000
    begun, number = [], itertools.count()
    with pytest.raises(StopRefiningError):
        Blocks(threads, 5, refuse_the_first).gather(3, lambda rows: (np.zeros(3),))
    assert begun == [3]
