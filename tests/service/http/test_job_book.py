"""The book of jobs: whose a job is, how long it is kept, and who makes room."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from service.errors import BusyError
from service.http.jobs.book import JobBook, NoSuchJobError
from service.workers.job import Job, State
from service.workers.memory_file import MemoryFile
from tests.support.handed_in import job_of


def run(scenario: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), 10))


def job(client: str, size: int = 0) -> Job:
    answer = MemoryFile()
    answer.append(bytes(size))
    made = job_of(b"", answer, client, seconds=0)
    made.body.release()
    made.page.close()
    made.state = State.DONE
    return made


def kept(book: JobBook, *jobs: Job) -> list[bool]:
    present: list[bool] = []
    for entry in jobs:
        try:
            book.find(entry.id, entry.client)
        except NoSuchJobError:
            present.append(False)
        else:
            present.append(True)
    return present


def test_what_a_named_client_made_is_for_it_alone() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=9)
        own, open_to_all = job("key:a"), job("address:1")
        book.add(own, "key:a")
        book.add(open_to_all, None)
        assert book.find(own.id, "key:a").job is own
        with pytest.raises(NoSuchJobError):
            book.find(own.id, "key:b")
        assert book.find(open_to_all.id, "anybody").job is open_to_all
        await book.close()
        own.answer.release()
        open_to_all.answer.release()

    run(scenario)


def test_where_room_is_needed_the_greediest_client_loses_its_oldest() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=50)
        greedy = [job("greedy", 30) for _ in range(3)]
        modest = job("modest", 10)
        for entry in (modest, *greedy):
            book.add(entry, None)
            book.keep(entry)
        assert book.bytes == 100
        last = job("modest", 5)
        book.add(last, None)
        book.keep(last)
        assert kept(book, modest, *greedy, last) == [True, False, True, True, True]
        assert greedy[0].answer.closed
        await book.close()
        assert modest.answer.closed

    run(scenario)


def test_many_small_results_are_bounded_too() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=2)
        jobs = [job("a") for _ in range(3)]
        for entry in jobs:
            book.add(entry, None)
            book.keep(entry)
        assert kept(book, *jobs) == [False, True, True]
        await book.close()

    run(scenario)


def test_a_job_that_was_struck_out_while_it_ran_keeps_no_result() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=2)
        gone = job("a", 10)
        book.add(gone, None)
        book.forget(gone.id)
        book.keep(gone)
        assert gone.answer.closed
        assert book.bytes == 0

    run(scenario)


@pytest.mark.parametrize("state", [State.FAILED, State.CANCELLED])
def test_jobs_without_results_are_bounded_too_and_the_greedy_loses_first(state: State) -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=3)
        modest = job("modest", 10)
        greedy = [job("greedy") for _ in range(5)]
        for one in (modest, *greedy):
            if one is not modest:
                one.state = state
            book.add(one, None)
            book.keep(one)
        assert kept(book, modest, *greedy) == [True, False, False, False, True, True]
        assert all(one.answer.closed for one in greedy)
        await book.close()
        assert modest.answer.closed

    run(scenario)


def test_a_job_without_a_result_is_kept_for_its_problem_and_no_file() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=100, max_jobs=2)
        failed = job("a", 10)
        failed.state = State.FAILED
        book.add(failed, None)
        book.keep(failed)
        assert failed.answer.closed
        assert kept(book, failed) == [True]
        await book.close()

    run(scenario)


def fetched(entry: Job) -> Job:
    entry.fetched.set()
    return entry


def test_tiny_jobs_of_many_addresses_push_out_no_result_that_is_promised() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=60, max_bytes=10**6, max_jobs=8)
        victim = job("victim", 8000)
        book.add(victim, None)
        book.keep(victim)
        tiny = [job(f"address:{number}", 1) for number in range(20)]
        for entry in tiny:
            book.add(entry, None)
            book.keep(entry)
        assert kept(book, victim) == [True]
        assert [entry.state for entry in tiny] == [State.DONE] * 7 + [State.FAILED] * 13
        with pytest.raises(BusyError):
            book.check_room(("address:another",))
        # A result that was fetched makes room for the next.
        fetched(tiny[3])
        book.check_room(("address:another",))
        last = job("address:another", 1)
        book.add(last, None)
        book.keep(last)
        assert kept(book, victim, tiny[3], last) == [True, False, True]
        await book.close()

    run(scenario)


def test_what_was_fetched_goes_first_then_what_is_small() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=0, max_bytes=10**6, max_jobs=3)
        large, small, taken = job("a", 9000), job("b", 10), fetched(job("c", 9000))
        for entry in (large, small, taken):
            book.add(entry, None)
            book.keep(entry)
        for name, gone in (("d", taken), ("e", small)):
            later = job(name, 500)
            book.add(later, None)
            book.keep(later)
            assert kept(book, gone) == [False]
        assert kept(book, large) == [True]
        await book.close()

    run(scenario)


def test_a_network_of_ipv6_fills_its_share_and_no_more() -> None:
    async def scenario() -> None:
        book = JobBook(seconds=60, promised_seconds=60, max_bytes=10**6, max_jobs=8)
        for number in range(8):
            entry = job(f"2001:db8:0:{number}::/64", 1)
            book.add(entry, None, (entry.client, "2001:db8::/56", "2001:db8::/48"))
            book.keep(entry)
        with pytest.raises(BusyError):
            book.check_room(("2001:db8:0:9::/64", "2001:db8::/56", "2001:db8::/48"))
        # Another site still has its place.
        book.check_room(("2001:db8:1::/64", "2001:db8:1::/56", "2001:db8:1::/48"))
        await book.close()

    run(scenario)
