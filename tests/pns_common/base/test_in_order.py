"""Values in order: each once, one at a time, whoever hands them in and whenever."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Event, Lock

import numpy as np
import pytest

from pns_common.base.in_order import InOrder


@pytest.mark.parametrize("seed", range(5))
def test_values_are_taken_in_the_order_of_their_numbers(seed):
    taken: list[int] = []
    values = InOrder(taken.append)
    for number in np.random.default_rng(seed).permutation(20).tolist():
        values.put(number, 10 * number)
    assert taken == list(range(0, 200, 10))


def test_threads_take_turns_and_leave_nothing_behind():
    taken: list[int] = []
    alone, start = Lock(), Barrier(4)

    def take(number: int) -> None:
        assert alone.acquire(blocking=False)
        taken.append(number)
        alone.release()

    values = InOrder(take)

    def put(own: int) -> None:
        start.wait()
        for number in range(own, 2000, 4):
            values.put(number, number)

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(put, range(4)))
    assert taken == list(range(2000))


def test_nobody_waits_for_the_one_whose_turn_it_is():
    begun, go_on, taken = Event(), Event(), list[int]()

    def take(number: int) -> None:
        begun.set()
        assert go_on.wait(10)
        taken.append(number)

    values = InOrder(take)
    with ThreadPoolExecutor(1) as other:
        first = other.submit(values.put, 0, 0)
        assert begun.wait(10)
        values.put(1, 1)
        assert taken == []
        go_on.set()
        first.result()
    # It was left to who had the turn.
    assert taken == [0, 1]


def test_what_comes_as_a_turn_ends_is_taken_too(monkeypatch):
    taken: list[int] = []
    values = InOrder(taken.append)

    class Held:
        """A turn at whose end another thread hands in one more value."""

        def __init__(self):
            self.lock = Lock()

        def acquire(self, blocking):
            return self.lock.acquire(blocking=blocking)

        def release(self):
            if taken == [0]:
                values.put(1, 1)
            self.lock.release()

    monkeypatch.setattr(values, "_taking", Held())
    values.put(0, 0)
    assert taken == [0, 1]
