"""Turns in the line: short jobs, fair shares, slots, and clients who leave."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from service.errors import BusyError
from service.workers.turns import Lane, Turns, Waiting


def run(scenario: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), 10))


def granted(*waiting: Waiting) -> list[bool]:
    return [job.turn.done() for job in waiting]


def test_a_short_job_has_a_worker_to_itself() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=9, short_seconds=0.5)
        large, next_large = turns.join("a", 30), turns.join("b", 30)
        short = turns.join("c", 0.1)
        assert granted(large, next_large, short) == [True, False, True]
        assert (large.lane, short.lane) == (Lane.ANY, Lane.SHORT)
        # A second short one waits for the first, or for any worker.
        second = turns.join("c", 0.1)
        assert granted(second) == [False]
        turns.end(large)
        assert second.lane is Lane.ANY
        assert granted(next_large) == [False]

    run(scenario)


def test_clients_take_turns_by_what_their_jobs_cost() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=9, short_seconds=0)
        running = turns.join("a", 1)
        many = [turns.join("a", 10) for _ in range(3)]
        lone = turns.join("b", 10)
        order: list[Waiting] = []
        while any(not waiting.turn.done() for waiting in (*many, lone)):
            turns.end(running)
            running = next(w for w in (*many, lone) if w.turn.done() and w not in order)
            order.append(running)
        # The second client comes before the first one's second job.
        assert order.index(lone) <= 1

    run(scenario)


def test_who_takes_more_than_was_predicted_stands_behind_the_others() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=9, short_seconds=0)
        running = turns.join("a", 0.01)
        many = [turns.join("a", 0.01) for _ in range(3)]
        lone = turns.join("b", 5)
        turns.end(running, 60)
        assert granted(*many, lone) == [False, False, False, True]
        # What it took is remembered of a client that has nothing in line, too.
        for waiting in many:
            turns.leave(waiting)
        later, fresh = turns.join("a", 0.01), turns.join("c", 20)
        turns.end(lone, 5)
        assert granted(later, fresh) == [False, True]

    run(scenario)


def test_who_leaves_before_a_turn_has_paid_for_nothing() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=9, short_seconds=0)
        running = turns.join("x", 1)
        given_up, kept = turns.join("a", 100), turns.join("a", 1)
        other = turns.join("b", 5)
        turns.leave(given_up)
        turns.end(running)
        assert granted(kept, other) == [True, False]
        # Nor where its turn came in the same moment.
        late = turns.join("c", 100)
        turns.end(kept)
        turns.end(other)
        assert granted(late) == [True]
        turns.leave(late)
        running = turns.join("x", 1)
        own, another = turns.join("c", 1), turns.join("d", 50)
        turns.end(running)
        assert granted(own, another) == [True, False]

    run(scenario)


def test_places_are_bounded_and_one_client_never_takes_all() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=4, short_seconds=0)
        turns.join("a", 10)
        for _ in range(3):
            turns.join("a", 10)
        with pytest.raises(BusyError, match="this client") as refusal:
            turns.join("a", 10)
        assert refusal.value.retry_after in (40, 41)
        turns.join("b", 10)
        with pytest.raises(BusyError, match="jobs wait"):
            turns.join("c", 10)
        assert turns.waiting == 4

    run(scenario)


def test_what_is_not_counted_takes_no_place() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=0, short_seconds=0)
        turns.join("a", 10)
        glance = turns.join("a", 0, counted=False)
        assert glance.lane is Lane.SHORT
        with pytest.raises(BusyError):
            turns.join("a", 10)

    run(scenario)


def test_who_leaves_makes_room_and_who_leaves_late_gives_the_turn_back() -> None:
    async def scenario() -> None:
        turns = Turns(workers=1, slots=2, short_seconds=0)
        first, second, third = (turns.join(name, 10) for name in "abc")
        assert [turns.place_of(job) for job in (second, third)] == [0, 1]
        coming = asyncio.create_task(turns.come(second))
        await asyncio.sleep(0)
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)
        assert turns.waiting == 1
        # Its turn comes, and it is cancelled before it can hear of it.
        coming = asyncio.create_task(turns.come(third))
        await asyncio.sleep(0)
        turns.end(first)
        assert granted(third) == [True]
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)
        assert turns.running[Lane.ANY] == 0
        assert turns.join("d", 10).lane is Lane.ANY

    run(scenario)


def test_the_backlog_is_what_is_in_front() -> None:
    async def scenario() -> None:
        turns = Turns(workers=2, slots=9, short_seconds=0)
        first = turns.join("a", 10)
        turns.join("b", 20)
        waiting = turns.join("c", 30)
        assert turns.backlog(first) == 0
        assert turns.backlog(waiting) == 15
        assert turns.backlog() == 30

    run(scenario)


def test_no_large_job_counts_as_in_front_of_a_short_one() -> None:
    """Else a short one is refused, or told to come back in minutes, though it is next."""

    async def scenario() -> None:
        turns = Turns(workers=1, slots=4, short_seconds=0.5)
        # Its turn by cost is behind those of the large ones.
        turns.end(turns.join("a", 0.25), 500)
        for client in "bcd":
            turns.join(client, 100)
        running = turns.join("b", 0.5)
        first, short = turns.join("c", 0.5), turns.join("a", 0.125)
        assert granted(running, first, short) == [True, False, False]
        assert turns.place_of(short) == 1
        assert turns.backlog(short) == 0.5
        turns.join("d", 0.5), turns.join("e", 0.5)
        with pytest.raises(BusyError) as refused:
            turns.join("f", 0.5)
        assert refused.value.retry_after == 2

    run(scenario)
