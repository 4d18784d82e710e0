"""Answers: a file from a worker, or a stream of how far its job is and then the file."""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
from collections.abc import AsyncGenerator, Coroutine
from contextlib import AsyncExitStack, aclosing
from typing import Any, TypeVar

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.responses import StreamingResponse
from starlette.types import Message, Receive, Scope, Send

from ..bodies import media
from ..errors import ServiceError
from ..workers.memory_file import MemoryFile
from ..workers.worker import JobFaultError
from . import problems
from .jobs import Job, Service, server_timing

log = logging.getLogger("pns.service")

T = TypeVar("T")

# How often the page of a running job is looked at, and how long a stream may be silent.
LOOK_SECONDS = 0.25
SILENT_SECONDS = 5.0


class Answer(StreamingResponse):
    """Sends pieces, and then lets go of what is held for them.

    A client that takes too long for a piece is cut off, and one whose place another needs. One that
    is gone is sent nothing more: the pieces would be read for nobody, and hold the event loop.
    """

    def __init__(
        self,
        service: Service,
        job: Job,
        held: AsyncExitStack,
        pieces: AsyncGenerator[bytes],
        media_type: str,
        headers: dict[str, str],
    ) -> None:
        super().__init__(pieces, media_type=media_type, headers=headers | {"Vary": "Accept"})
        self._pieces = pieces
        self._stall_seconds = service.settings.stall_seconds
        self._end, self._held = job.end, held

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer."""
        async with self._held:
            try:
                async with self._end:
                    await unless_gone(receive, self._sent(send))
            except ClientDisconnect:
                return
            except TimeoutError:
                why = "its place is needed" if self._end.expired() else "its client is too slow"
                log.warning("an answer is cut off: %s", why)

    async def _sent(self, send: Send) -> None:
        async def in_time(message: Message) -> None:
            # To one who is gone `send` returns at once: others are to have a turn.
            await asyncio.sleep(0)
            async with asyncio.timeout(self._stall_seconds):
                await send(message)

        async with aclosing(self._pieces):
            await self.stream_response(in_time)


def file_answer(
    service: Service, job: Job, held: AsyncExitStack, media_type: str, content: MemoryFile
) -> Answer:
    """Answer with a memory file."""

    async def pieces() -> AsyncGenerator[bytes]:
        with service.places.taking(job.client.id, job.end):
            for piece in content.pieces():
                yield piece

    headers = {"Content-Length": str(content.size), "Server-Timing": server_timing(job.seconds)}
    return Answer(service, job, held, pieces(), media_type, headers)


def stream_answer(
    service: Service, job: Job, held: AsyncExitStack, file_type: str, request: Request
) -> Answer:
    """Do a job and answer with its progress, at least every five seconds; then file and report.

    Or, in their place, the problem. Each part says what it is by `Content-Description`. Only a
    stream that ends with the closing boundary is whole.
    """
    boundary = secrets.token_hex(16)
    # It follows each part at once: so its reader knows that it is whole.
    end = f"\r\n--{boundary}".encode()

    async def parts() -> AsyncGenerator[bytes]:
        work = asyncio.create_task(service.serve(job))
        try:
            yield end[2:]
            said, silent = b"", 0.0
            while not work.done():
                now = _progress(service, job)
                if now != said or silent >= SILENT_SECONDS:
                    said, silent = now, 0.0
                    yield _head("progress", media.JSON) + now + end
                await asyncio.wait({work}, timeout=LOOK_SECONDS)
                silent += LOOK_SECONDS
            try:
                work.result()
            except (ServiceError, JobFaultError) as error:
                document = problems.of_failure(error)
                # For the journal.
                request.state.problem = document.code
                yield _head("problem", problems.MEDIA_TYPE) + bytes(document.body) + end
            else:
                timing = f"Server-Timing: {server_timing(job.seconds)}"
                files = ("file", file_type, job.answer), ("report", media.JSON, job.report)
                with service.places.taking(job.client.id, job.end):
                    for name, kind, file in files:
                        yield _head(name, kind, f"Content-Length: {file.size}", timing)
                        for piece in file.pieces():
                            yield piece
                        yield end
            yield b"--\r\n"
        finally:
            work.cancel()
            await asyncio.gather(work, return_exceptions=True)

    # A proxy that collects the stream (nginx) would keep it until its end.
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return Answer(service, job, held, parts(), f"{media.MIXED}; boundary={boundary}", headers)


def _head(name: str, kind: str, *more: str) -> bytes:
    """Return the head of a part."""
    headers = f"Content-Type: {kind}", f"Content-Description: {name}", *more
    return "\r\n".join(("", *headers, "", "")).encode()


def _progress(service: Service, job: Job) -> bytes:
    page = None if job.turn is None else job.turn.progress
    told = {
        "state": "queued" if page is None else "running",
        "place": service.workers.place(job.turn) if page is None else None,
        "stage": None if page is None else page.stage,
        "share": 0.0 if page is None else round(page.share, 4),
    }
    return json.dumps(told, separators=(",", ":")).encode()


async def unless_gone(receive: Receive, work: Coroutine[Any, Any, T]) -> T:
    """Return the value of `work`, cancelled if the client disconnects. Raises ClientDisconnect."""
    job = asyncio.create_task(work)
    gone = asyncio.create_task(_until_gone(receive))
    try:
        await asyncio.wait({job, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not job.done():
            raise ClientDisconnect
        return job.result()
    finally:
        job.cancel()
        gone.cancel()
        await asyncio.gather(job, gone, return_exceptions=True)


async def _until_gone(receive: Receive) -> None:
    """Wait until the client has left; the body has been read."""
    while (await receive())["type"] != "http.disconnect":
        pass


def answer_type(request: Request, file_type: str = media.GLB) -> str:
    """Return the media type that the client wants most; `file_type` is that of the file.

    Generated clients know a file by `application/octet-stream` alone, and may ask for that.
    """
    # Several lines of it are one; without any, all are equal.
    accept = ",".join(request.headers.getlist("accept"))
    # In the order of preference among equals.
    kinds = (file_type, media.JSON, media.BYTES, media.MIXED)
    return max(kinds, key=lambda kind: media.quality(kind, accept))


def is_known(tag: str, request: Request) -> bool:
    """Return whether the client has the content of an ETag: its If-None-Match says so."""
    sent = request.headers.get("if-none-match", "").split(",")
    return bool({one.strip().removeprefix("W/") for one in sent} & {tag, "*"})
