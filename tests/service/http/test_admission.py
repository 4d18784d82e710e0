"""The admission by itself: slots, bytes, and how those inside are told to leave."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from service.errors import BusyError
from service.http.admission import Admission, CutOffError, DrainingError


def run(scenario: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), 10))


def test_uploads_and_jobs_are_counted_apart() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=2, body_bytes=10, answer_bytes=10)
        async with admission.upload(), admission.upload(), admission.working():
            assert admission.admitted == 3
            with pytest.raises(BusyError, match="uploads"):
                async with admission.upload():
                    pass
        assert admission.admitted == 0

    run(scenario)


def test_where_answers_leave_no_room_the_oldest_is_cut_off() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=10, answer_bytes=10)

        async def taking(size: int, until: asyncio.Event) -> str:
            try:
                async with admission.answering(size):
                    await until.wait()
            except CutOffError:
                return "cut off"
            return "taken"

        end = asyncio.Event()
        takers: list[asyncio.Task[str]] = []
        for size in (4, 4, 5):
            takers.append(asyncio.create_task(taking(size, end)))
            await asyncio.sleep(0)
        assert await takers[0] == "cut off"
        end.set()
        assert await takers[1] == await takers[2] == "taken"

    run(scenario)


def test_bodies_share_their_bytes_and_give_them_back() -> None:
    admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
    with admission.body("a") as first, admission.body("b") as second:
        first(5)
        second(3)
        with pytest.raises(BusyError):
            second(1)
    with admission.body("a") as third:
        third(6)


def test_one_client_never_holds_all_bytes() -> None:
    admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
    with admission.body("a") as first, admission.body("a") as second, admission.body("b") as other:
        first(4)
        second(2)
        with pytest.raises(BusyError):
            second(1)
        other(2)


def test_who_is_told_to_leave_leaves_with_a_reason() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=10, answer_bytes=10)

        async def uploading() -> None:
            async with admission.upload():
                await asyncio.sleep(60)

        async def working() -> None:
            async with admission.working():
                await asyncio.sleep(60)

        upload = asyncio.create_task(uploading())
        await asyncio.sleep(0)
        job = asyncio.create_task(working())
        await asyncio.sleep(0)
        admission.end_uploads()
        with pytest.raises(DrainingError):
            await upload
        assert admission.admitted == 1
        assert not job.done()
        admission.end()
        admission.end()
        with pytest.raises(DrainingError):
            await job
        assert admission.admitted == 0

    run(scenario)


def test_while_draining_no_upload_begins_and_what_has_begun_goes_on() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=2, body_bytes=10, answer_bytes=10)
        async with admission.upload():
            admission.draining = True
            with pytest.raises(DrainingError, match="no new request"):
                async with admission.upload():
                    pass
            assert admission.admitted == 1
            # A job whose body is here may still begin.
            async with admission.working():
                assert admission.admitted == 2

    run(scenario)


def test_a_timeout_of_the_work_itself_stays_one() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=10, answer_bytes=10)
        for held in (admission.upload(), admission.working(), admission.answering(1)):
            with pytest.raises(TimeoutError):
                async with held, asyncio.timeout(0):
                    await asyncio.sleep(60)

    run(scenario)
