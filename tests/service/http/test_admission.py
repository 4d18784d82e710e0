"""The admission by itself: slots, bytes, and how those inside are told to leave."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from service.errors import BusyError
from service.http.admission import Admission, CutOffError, DrainingError
from service.http.layers import Crowd, Endings


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


def taken(answers: list[tuple[str, int]]) -> list[str]:
    """Return the outcome of answers, of whom and how large, that are begun one after another."""
    outcomes: list[str] = []

    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=10, answer_bytes=10)
        end = asyncio.Event()

        async def take(client: str, size: int) -> str:
            try:
                async with admission.answering(client, size):
                    await end.wait()
            except CutOffError:
                return "cut off"
            except BusyError:
                return "refused"
            return "taken"

        takers: list[asyncio.Task[str]] = []
        for client, size in answers:
            takers.append(asyncio.create_task(take(client, size)))
            await asyncio.sleep(0)
        end.set()
        outcomes.extend(await asyncio.gather(*takers))

    run(scenario)
    return outcomes


def test_where_answers_leave_no_room_the_greediest_client_loses_its_oldest() -> None:
    assert taken([("a", 4), ("a", 4), ("a", 5)]) == ["cut off", "taken", "taken"]
    # Its own new ones count: however often it asks, nobody else is cut off.
    assert taken([("a", 3), *[("b", 4)] * 5]) == ["taken", *["cut off"] * 4, "taken"]
    # Of equals who has had it for longer, and an answer that is larger than all room comes alone.
    assert taken([("a", 6), ("b", 6)]) == ["cut off", "taken"]
    assert taken([("a", 20)]) == ["taken"]


def test_an_answer_larger_than_what_anyone_takes_waits_for_another_time() -> None:
    assert taken([("a", 4), ("b", 4), ("c", 5)]) == ["taken", "taken", "refused"]
    # Nobody is cut off for one who is refused then.
    assert taken([("a", 3), ("a", 3), ("b", 4), ("c", 5)]) == [*["taken"] * 3, "refused"]


def test_bodies_share_their_bytes_and_give_them_back() -> None:
    admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
    with admission.body("a") as first, admission.body("b") as second:
        first.grow(5)
        second.grow(3)
        with pytest.raises(BusyError):
            second.grow(1)
    with admission.body("a") as third:
        third.grow(6)


def test_one_client_never_holds_all_bytes() -> None:
    admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
    with admission.body("a") as first, admission.body("a") as second, admission.body("b") as other:
        first.grow(4)
        second.grow(2)
        with pytest.raises(BusyError):
            second.grow(1)
        other.grow(2)


def sent(bodies: list[tuple[str, int, str]]) -> list[str]:
    """Return the outcome of bodies, of whom, how large, and whole or on their way.

    They come one after another, in pieces of one byte; there is room for eight bytes.
    """
    outcomes: list[str] = []

    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
        end = asyncio.Event()

        async def send(client: str, size: int, state: str) -> str:
            try:
                with admission.body(client) as body:
                    async with body.arriving():
                        for _ in range(size):
                            body.grow(1)
                        if state == "arriving":
                            await end.wait()
                    await end.wait()
            except BusyError as error:
                return "gave way" if "given way" in error.detail else "refused"
            return "kept"

        senders: list[asyncio.Task[str]] = []
        for body in bodies:
            senders.append(asyncio.create_task(send(*body)))
            await asyncio.sleep(0)
        end.set()
        outcomes.extend(await asyncio.gather(*senders))
        with admission.body("z") as all_that_one_may_have:
            all_that_one_may_have.grow(6)

    run(scenario)
    return outcomes


def test_bodies_that_do_not_come_to_an_end_lock_nobody_out() -> None:
    two = [("a", 4, "arriving"), ("b", 4, "arriving")]
    assert sent([*two, ("c", 3, "whole")]) == ["gave way", "kept", "kept"]
    # Of one client the oldest goes, of several that of who holds most, jobs' bodies included.
    one = [("a", 2, "arriving"), ("a", 4, "arriving"), ("b", 2, "arriving")]
    assert sent([*one, ("c", 1, "whole")]) == ["gave way", "kept", "kept", "kept"]
    most = [("b", 3, "arriving"), ("a", 3, "whole"), ("a", 2, "arriving")]
    assert sent([*most, ("c", 2, "whole")]) == ["kept", "kept", "gave way", "kept"]


def test_a_body_gives_way_to_nobody_who_holds_as_much_and_that_of_a_job_to_nobody() -> None:
    two = [("a", 4, "arriving"), ("b", 4, "arriving")]
    assert sent([*two, ("a", 1, "whole")]) == ["kept", "kept", "refused"]
    whole = [("a", 4, "whole"), ("b", 4, "whole")]
    assert sent([*whole, ("c", 1, "whole")]) == ["kept", "kept", "refused"]


def test_a_body_that_was_whole_when_it_was_told_has_given_way() -> None:
    async def scenario() -> None:
        admission = Admission(uploads=1, body_bytes=8, answer_bytes=10)
        with admission.body("a") as first, admission.body("b") as second:
            second.grow(3)

            async def arrive() -> None:
                async with first.arriving():
                    first.grow(5)
                    second.grow(1)

            with pytest.raises(BusyError, match="given way"):
                await arrive()

    run(scenario)


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
        for held in (admission.upload(), admission.working(), admission.answering("a", 1)):
            with pytest.raises(TimeoutError):
                async with held, asyncio.timeout(0):
                    await asyncio.sleep(60)

    run(scenario)


def test_a_probe_passes_a_crowd_and_what_is_too_much_is_refused() -> None:
    """Requests begin one in a turn of the event loop; a probe begins as it comes."""
    begun: list[str] = []
    sent: list[dict[str, Any]] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        begun.append(scope["path"])

    async def send(message: Message) -> None:
        sent.append(dict(message))

    async def scenario() -> None:
        crowd = Crowd(app, 100)
        receive: Any = None

        def come(path: str) -> asyncio.Task[None]:
            return asyncio.create_task(crowd({"type": "http", "path": path}, receive, send))

        requests = [come(f"/{number}") for number in range(101)]
        await asyncio.sleep(0)
        await come("/healthz")
        assert len(begun) < 10
        await asyncio.gather(*requests)

    asyncio.run(scenario())
    assert [path for path in begun if path != "/healthz"] == [f"/{n}" for n in range(100)]
    assert sent[0]["status"] == 503
    assert b"retry-after" in dict(sent[0]["headers"])


@pytest.mark.parametrize(
    ("headers", "arrives", "ends"),
    [
        pytest.param([], [], True, id="no body"),
        pytest.param([(b"content-length", b"0")], [], True, id="an empty body"),
        pytest.param([(b"content-length", b"9")], [], False, id="a body that is not read"),
        pytest.param([(b"transfer-encoding", b"chunked")], [True], False, id="half a body"),
        pytest.param([(b"content-length", b"9")], [True, False], True, id="a whole body"),
    ],
)
def test_a_service_that_leaves_ends_no_connection_on_a_body_that_is_still_sent(
    headers: list[tuple[bytes, bytes]], arrives: list[bool], ends: bool
) -> None:
    """The rest of it would meet a reset, and the answer be lost with it."""
    sent: list[dict[str, Any]] = []
    pieces = iter([{"type": "http.request", "body": b"x", "more_body": more} for more in arrives])

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        for _ in arrives:
            await receive()
        await send({"type": "http.response.start", "status": 503, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def receive() -> Message:
        return next(pieces)

    async def send(message: Message) -> None:
        sent.append(dict(message))

    scope = {"type": "http", "http_version": "1.1", "method": "POST", "headers": headers}
    asyncio.run(Endings(app, lambda: True)(scope, receive, send))
    assert ((b"connection", b"close") in sent[0]["headers"]) == ends
