"""The way of a job: its request is checked, its body comes, a worker does it, its answer goes."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass, field

from fastapi import Request

from ..bodies import media
from ..errors import (
    InvalidParameter,
    ServiceError,
    UnreadableError,
    check_choice,
    check_limit,
)
from ..log_lines import REQUEST_ID
from ..settings import Settings
from ..workers.jobs import Done, Work
from ..workers.memory_file import MemoryFile
from ..workers.models import Catalogue
from ..workers.pool import Turn, Workers
from .access.clients import Client, FacesBudget, Places, client_of
from .parameters import Parameters

log = logging.getLogger("pns.service")


class UploadTimeoutError(ServiceError):
    """The body took longer to arrive than an upload may."""

    status = 408
    code = "upload-timeout"
    title = "The upload took too long"


@dataclass(eq=False)
class Job:
    """A job: what its worker is told and fills, and when it came and began.

    One of `answer` and `report` may stay empty, where nobody wants it. `end` cuts its answer off.
    """

    client: Client
    work: Work
    answer: MemoryFile
    report: MemoryFile
    upload_seconds: float
    admitted: float = field(default_factory=time.monotonic)
    end: asyncio.Timeout = field(default_factory=lambda: asyncio.timeout(None))
    turn: Turn | None = None
    done: Done | None = None

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of each stage that there has been, from the first byte of the body."""
        seconds = {"upload": self.upload_seconds}
        if self.turn is not None and self.turn.began is not None:
            seconds["queue"] = self.turn.began - self.admitted
        if self.done is not None:
            seconds |= self.done.seconds | {
                "total": self.upload_seconds + time.monotonic() - self.admitted
            }
        return seconds


class Service:
    """One service: its settings, its workers, who is inside, and its models.

    `run` is what a worker calls for a job, `read` for the catalogue; `watch` is told of each job
    that has ended, `heard` of the catalogue once.
    """

    def __init__(
        self,
        settings: Settings,
        workers: Workers,
        run: Callable[[Work], Done],
        read: Callable[[], Catalogue],
        watch: Callable[[Job], None],
        heard: Callable[[Catalogue], None],
    ) -> None:
        self.settings = settings
        self.workers = workers
        self.places = Places(settings.workers + settings.queue, settings.client_requests)
        self._budget = FacesBudget()
        self._run, self._read = run, read
        self._watch, self._heard = watch, heard
        self._catalogue: Catalogue | None = None
        self._reading = asyncio.Lock()

    async def catalogue(self) -> Catalogue:
        """Return the models: read in a worker when first wanted, then kept. Raises ServiceError."""
        async with self._reading:
            if self._catalogue is None:
                self._catalogue = await self.workers.run(self.workers.join(""), self._read)
                self._heard(self._catalogue)
            return self._catalogue

    @asynccontextmanager
    async def received(
        self, request: Request, parameters: Parameters, *, answer: bool, report: bool
    ) -> AsyncIterator[Job]:
        """Yield the job of a request, once its body is there; its place and files last as long.

        Raises:
            ServiceError: the parameters are wrong, the body does not arrive, or there is no room.
        """
        settings = self.settings
        _refuse_repeated(request)
        options = parameters.options()
        check_limit("levels", options.levels, settings.levels, f"levels is {options.levels}")
        content_type = request.headers.get("content-type", "")
        media.of_request(content_type)
        encoding = media.encoding_of(request.headers.get("content-encoding", ""))
        announced = request.headers.get("content-length", "0")
        if not announced.isdecimal():
            raise UnreadableError("Content-Length is not a number")
        size = int(announced)
        check_limit("body", size, int(settings.body), f"the body has {size} bytes")
        client = client_of(request, settings)
        self._budget.check(client)
        with ExitStack() as held:
            held.enter_context(self.places.held(client.id))
            if parameters.model is not None:
                check_choice("model", parameters.model, (await self.catalogue()).names)
            began = time.monotonic()
            body = held.enter_context(MemoryFile())
            await self._receive(request, body)
            answer_file = held.enter_context(MemoryFile())
            report_file = held.enter_context(MemoryFile())
            work = Work(
                body=body.name,
                answer=answer_file.name if answer else None,
                report=report_file.name if report else None,
                content_type=content_type,
                options=options,
                model=parameters.model,
                limits=settings.job_limits(),
                target=parameters.format,
                request_id=REQUEST_ID.get(),
                encoding=encoding,
                body_bytes=int(settings.body),
            )
            upload_seconds = time.monotonic() - began
            yield Job(client, work, answer_file, report_file, upload_seconds)

    async def _receive(self, request: Request, body: MemoryFile) -> None:
        """Take a body in, piece by piece. Raises LimitError, UploadTimeoutError, NoStorageError."""
        settings, size = self.settings, 0
        pieces = aiter(request.stream())
        try:
            async with asyncio.timeout(settings.upload_seconds):
                while True:
                    async with asyncio.timeout(settings.idle_seconds):
                        piece = await anext(pieces, None)
                    if piece is None:
                        return
                    size += len(piece)
                    text = f"the body has {size} bytes or more"
                    check_limit("body", size, int(settings.body), text)
                    body.append(piece)
        except TimeoutError as error:
            raise UploadTimeoutError(
                f"the body did not arrive within {settings.upload_seconds:g} seconds, "
                f"or nothing of it for {settings.idle_seconds:g}"
            ) from error

    async def serve(self, job: Job) -> None:
        """Take a job to its end. Cancelling this call ends the job.

        Raises:
            ServiceError: it failed; JobFaultError: by a fault of ours.
        """
        job.turn = self.workers.join(job.client.id)
        try:
            job.done = await self.workers.run(job.turn, self._run, job.work)
            self._budget.charge(job.client, job.done.faces)
            options, model = job.work.options, job.done.model
            what = options.scheme if model is None else f"{options.scheme} ({model})"
            log.info("%s levels=%d: %s", what, options.levels, server_timing(job.seconds))
        finally:
            self._watch(job)


def server_timing(seconds: dict[str, float]) -> str:
    """Return the value of `Server-Timing`: milliseconds by stage."""
    return ", ".join(f"{stage};dur={1000 * value:.1f}" for stage, value in seconds.items())


def _refuse_repeated(request: Request) -> None:
    """Refuse a parameter that is given twice: one value would be lost without a word."""
    given = Counter(name for name, _ in request.query_params.multi_items())
    for name, count in given.items():
        if count > 1:
            raise InvalidParameter(name, f"{name} is given {count} times")
