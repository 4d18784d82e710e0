"""From a request to a job: its parameters are checked, its body is taken in."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import Request

from ..bodies import media
from ..bodies.media import encoding_of
from ..errors import InvalidParameter, check_limit
from ..log_lines import REQUEST_ID
from ..settings import Settings
from ..workers.job import Job
from ..workers.jobs import Work
from ..workers.memory_file import MemoryFile
from ..workers.progress import ProgressPage
from .clients import client_of
from .parameters import Parameters
from .service import Service


@dataclass(frozen=True, slots=True)
class Wanted:
    """Result that a request wants: in a `folder` on disk, or (None) in memory.

    `patience` is how long its job may take from its admission, waiting included.
    """

    answer: bool
    report: bool
    folder: Path | None
    patience: float


@asynccontextmanager
async def taken_in(
    service: Service, request: Request, parameters: Parameters, wanted: Wanted
) -> AsyncIterator[Job]:
    """Yield the job of a request, once its body is there; the body's bytes count until the end.

    Whoever takes the job lets go of what is wanted; where this raises, nothing is left.

    Raises:
        ServiceError: the parameters are wrong, the body does not arrive, or there is no room.
    """
    settings = service.settings
    _refuse_repeated(request)
    options = parameters.options()
    await service.models.check(parameters.model)
    check_limit("levels", options.levels, settings.levels, f"levels is {options.levels}")
    content_type = request.headers.get("content-type", "")
    media.of_request(content_type)
    encoding = encoding_of(request.headers.get("content-encoding", ""))
    client = client_of(request, settings)
    # It would be sent for nothing.
    service.desk.turns.check_room(client.id)

    async with AsyncExitStack() as held:
        began = time.perf_counter()
        counted = held.enter_context(service.admission.body(client.id))
        with ExitStack() as files:
            body = files.enter_context(MemoryFile())
            async with service.admission.upload(), counted.arriving():
                async for piece in request.stream():
                    counted.grow(len(piece))
                    body.append(piece)
            job = made_of(
                settings,
                body,
                wanted,
                client.id,
                options=options,
                model=parameters.model,
                target=parameters.format,
                content_type=content_type,
                encoding=encoding,
                request_id=REQUEST_ID.get(),
            )
            # From here on the body is the job's.
            files.pop_all()
        job.faces_per_minute = client.faces_per_minute
        job.upload_seconds = time.perf_counter() - began
        # Also where its work never begins.
        held.callback(job.close)
        yield job


def made_of(settings: Settings, body: MemoryFile, wanted: Wanted, client: str, **asked: Any) -> Job:
    """Make the job of a body that is there, with the files that it fills.

    `asked` are the fields of `Work` that a request names. Raises NoStorageError.
    """
    with ExitStack() as files:
        page = files.enter_context(ProgressPage())
        answer = files.enter_context(MemoryFile(wanted.folder)) if wanted.answer else None
        report = files.enter_context(MemoryFile(wanted.folder)) if wanted.report else None
        work = Work(
            body=body.name,
            answer=None if answer is None else answer.name,
            report=None if report is None else report.name,
            page=page.file.name,
            limits=settings.job_limits(),
            answer_bytes=None if wanted.folder is None else int(settings.result_bytes),
            body_bytes=int(settings.body),
            **asked,
        )
        files.pop_all()
    return Job(
        client=client,
        faces_per_minute=None,
        work=work,
        body=body,
        answer=answer,
        report=report,
        page=page,
        upload_seconds=0.0,
        must_end=time.monotonic() + wanted.patience,
    )


def _refuse_repeated(request: Request) -> None:
    """Refuse a parameter that is given twice: one value would be lost without a word."""
    given = Counter(name for name, _ in request.query_params.multi_items())
    for name, count in given.items():
        if count > 1:
            raise InvalidParameter(name, f"{name} is given {count} times")
