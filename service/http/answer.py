"""Answers: a file from a worker, or a stream of how far its job is and then the file."""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
from collections.abc import AsyncGenerator, Coroutine
from contextlib import AbstractContextManager, AsyncExitStack, aclosing
from typing import Any, TypeVar

from fastapi import Request
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

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


class _Answer(Response):
    """Sends pieces, and then lets go of what is held for them.

    A client that takes too long for a piece is cut off, and one whose place another needs. One that
    is gone is sent nothing more: the pieces would be read for nobody, and hold the event loop.
    """

    def __init__(
        self,
        service: Service,
        job: Job,
        held: AsyncExitStack,
        media_type: str,
        headers: dict[str, str],
    ) -> None:
        super().__init__(media_type=media_type, headers=headers | {"Vary": "Accept"})
        # Of a body that is not known yet, Starlette has said that it is empty.
        if "Content-Length" not in headers:
            del self.headers["Content-Length"]
        self._service, self._job = service, job
        self._held = held
        self._end = asyncio.timeout(None)

    def pieces(self, scope: Scope, receive: Receive) -> AsyncGenerator[bytes]:
        """Yield the body."""
        raise NotImplementedError

    def _taking(self) -> AbstractContextManager[None]:
        return self._service.places.taking(self._job.client.id, self._end)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer."""
        async with self._held:
            await send(
                {
                    "type": "http.response.start",
                    "status": self.status_code,
                    "headers": self.raw_headers,
                }
            )
            try:
                async with self._end, aclosing(self.pieces(scope, receive)) as pieces:
                    async for piece in pieces:
                        # To one who is gone `send` returns at once: others are to have a turn.
                        await asyncio.sleep(0)
                        async with asyncio.timeout(self._service.settings.stall_seconds):
                            await send(
                                {"type": "http.response.body", "body": piece, "more_body": True}
                            )
            except ClientDisconnect:
                return
            except TimeoutError:
                why = "its place is needed" if self._end.expired() else "its client is too slow"
                log.warning("an answer is cut off: %s", why)
                return
            await send({"type": "http.response.body", "body": b""})


class FileAnswer(_Answer):
    """Sends a memory file."""

    def __init__(
        self, service: Service, job: Job, held: AsyncExitStack, media_type: str, content: MemoryFile
    ) -> None:
        headers = {
            "Content-Length": str(content.size),
            "Server-Timing": server_timing(job.seconds),
        }
        super().__init__(service, job, held, media_type, headers)
        self._content = content

    async def pieces(self, scope: Scope, receive: Receive) -> AsyncGenerator[bytes]:
        """Yield the file. Raises ClientDisconnect once its client has left."""
        gone = asyncio.create_task(_until_gone(receive))
        try:
            with self._taking():
                for piece in self._content.pieces():
                    yield piece
                    if gone.done():
                        raise ClientDisconnect
        finally:
            gone.cancel()


class StreamAnswer(_Answer):
    """Does a job and sends how far it is, at least every five seconds; then the file and report.

    Or, in their place, the problem. Each part says what it is by `Content-Description`. Only a
    stream that ends with the closing boundary is whole.
    """

    def __init__(self, service: Service, job: Job, held: AsyncExitStack, file_type: str) -> None:
        self._boundary = secrets.token_hex(16)
        super().__init__(
            service,
            job,
            held,
            f"{media.MIXED}; boundary={self._boundary}",
            # A proxy that collects the stream (nginx) would keep it until its end.
            {"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )
        self._file_type = file_type

    async def pieces(self, scope: Scope, receive: Receive) -> AsyncGenerator[bytes]:
        """Yield the parts. Raises ClientDisconnect once its client has left."""
        job = self._job
        work = asyncio.create_task(self._service.serve(job))
        gone = asyncio.create_task(_until_gone(receive))
        # A boundary follows each part at once: so its reader knows that it is whole.
        end = f"\r\n--{self._boundary}".encode()
        try:
            yield end[2:]
            said, silent = b"", 0.0
            while not work.done():
                now = self._progress()
                if now != said or silent >= SILENT_SECONDS:
                    said, silent = now, 0.0
                    yield self._head("progress", media.JSON) + now + end
                await asyncio.wait(
                    {work, gone}, timeout=LOOK_SECONDS, return_when=asyncio.FIRST_COMPLETED
                )
                silent += LOOK_SECONDS
                if gone.done():
                    raise ClientDisconnect
            try:
                work.result()
            except (ServiceError, JobFaultError) as error:
                document = problems.of_failure(error)
                # For the journal.
                scope["state"]["problem"] = document.code
                yield self._head("problem", problems.MEDIA_TYPE) + bytes(document.body) + end
            else:
                timing = f"Server-Timing: {server_timing(job.seconds)}"
                with self._taking():
                    for name, kind, file in (
                        ("file", self._file_type, job.answer),
                        ("report", media.JSON, job.report),
                    ):
                        yield self._head(name, kind, f"Content-Length: {file.size}", timing)
                        for piece in file.pieces():
                            yield piece
                            if gone.done():
                                raise ClientDisconnect
                        yield end
            yield b"--\r\n"
        finally:
            gone.cancel()
            work.cancel()
            await asyncio.gather(work, gone, return_exceptions=True)

    def _head(self, name: str, kind: str, *more: str) -> bytes:
        headers = f"Content-Type: {kind}", f"Content-Description: {name}", *more
        return "\r\n".join(("", *headers, "", "")).encode()

    def _progress(self) -> bytes:
        turn, page = self._job.turn, self._job.page
        waits = turn is None or turn.began is None
        return json.dumps(
            {
                "state": "queued" if waits else "running",
                "place": self._service.workers.place(turn) if waits else None,
                "stage": page.stage,
                "share": round(page.share, 4),
            },
            separators=(",", ":"),
        ).encode()


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
