"""The course of a job: parts of parts, and a share that never goes back."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from hypothesis import given
from hypothesis import strategies as st

from service.course import Course


def test_parts_of_parts_tell_their_own_shares() -> None:
    told: list[float] = []
    course = Course(moves=told.append)
    with course.part(0.5, 1.0):
        course.reach(0.5)
        with course.part(0.5, 0.75):
            course.reach(0.5)
        course.reach(1.0)
    assert told == [0.5, 0.75, 0.75, 0.8125, 0.875, 1.0, 1.0]


@given(st.lists(st.floats(0, 1)))
def test_the_share_never_goes_back(shares: list[float]) -> None:
    told: list[float] = []
    course = Course(moves=told.append)
    for share in shares:
        course.reach(share)
    assert told == [max(shares[: count + 1]) for count in range(len(shares))]


def test_many_threads_may_tell() -> None:
    told: list[float] = []
    course = Course(moves=told.append)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda number: course.reach(number / 1000), range(1001)))
    assert told == sorted(told)
    assert len(told) == 1001
    assert told[-1] == 1
