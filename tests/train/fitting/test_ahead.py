"""An iterator in a process of its own: the same values, errors too, and nothing left behind."""

import multiprocessing
from itertools import count, islice

import pytest

from train.fitting.ahead import ahead


def test_values_come_in_order_and_end():
    assert list(ahead(range, 2, 9, 3)) == [2, 5, 8]
    assert multiprocessing.active_children() == []


def test_an_error_comes_after_the_values_before_it():
    made = ahead(map, int, ["7", "seven"])
    assert next(made) == 7
    with pytest.raises(ValueError, match="seven"):
        next(made)


def test_who_stops_early_leaves_no_process():
    made = ahead(count)
    assert list(islice(made, 3)) == [0, 1, 2]
    made.close()
    assert multiprocessing.active_children() == []


def test_a_process_that_is_killed_is_missed():
    made = ahead(count)
    next(made)
    (process,) = multiprocessing.active_children()
    process.kill()
    with pytest.raises(EOFError):
        list(made)
