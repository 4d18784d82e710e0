"""The gate by itself: places, bytes, and how those inside are told to leave."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from service.errors import BusyError
from service.gate import DrainingError, Gate


def run(scenario: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(asyncio.wait_for(scenario(), 10))


def test_uploads_take_no_jobs_place() -> None:
    async def scenario() -> None:
        gate = Gate(jobs=1, uploads=2, body_bytes=10)
        async with gate.upload(), gate.upload():
            with gate.job():
                assert gate.admitted == 3
                with pytest.raises(BusyError, match="jobs"), gate.job():
                    pass
            with pytest.raises(BusyError, match="uploads"):
                async with gate.upload():
                    pass
        assert gate.admitted == 0

    run(scenario)


def test_no_body_is_taken_that_no_job_could_follow() -> None:
    async def scenario() -> None:
        gate = Gate(jobs=1, uploads=2, body_bytes=10)
        with gate.job(), pytest.raises(BusyError):
            async with gate.upload():
                pass

    run(scenario)


def test_bodies_share_their_bytes_and_give_them_back() -> None:
    gate = Gate(jobs=1, uploads=1, body_bytes=10)
    with gate.body() as first, gate.body() as second:
        first(6)
        second(4)
        with pytest.raises(BusyError):
            first(1)
    with gate.body() as third:
        third(10)


def test_who_is_told_to_leave_leaves_with_a_reason() -> None:
    async def scenario() -> None:
        gate = Gate(jobs=1, uploads=1, body_bytes=10)

        async def uploading() -> None:
            async with gate.upload():
                await asyncio.sleep(60)

        async def working() -> None:
            with gate.job():
                async with gate.working():
                    await asyncio.sleep(60)

        upload = asyncio.create_task(uploading())
        await asyncio.sleep(0)
        job = asyncio.create_task(working())
        await asyncio.sleep(0)
        gate.end_uploads()
        with pytest.raises(DrainingError):
            await upload
        assert gate.admitted == 1
        assert not job.done()
        gate.end()
        gate.end()
        with pytest.raises(DrainingError):
            await job
        assert gate.admitted == 0

    run(scenario)


def test_a_timeout_of_the_work_itself_stays_one() -> None:
    async def scenario() -> None:
        gate = Gate(jobs=1, uploads=1, body_bytes=10)
        with pytest.raises(TimeoutError):
            async with gate.working(), asyncio.timeout(0):
                await asyncio.sleep(60)

    run(scenario)
