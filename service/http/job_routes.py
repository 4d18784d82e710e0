"""Jobs: hand in a file, come back for the result."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, ExitStack, suppress
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response, StreamingResponse

from ..bodies import media
from ..errors import ServiceError
from ..workers.job import Job, State
from ..workers.worker import JobFaultError
from . import documentation, problems
from .admission import DrainingError
from .answer import FileAnswer
from .answer_types import answer_type
from .clients import client_of
from .connection.crowd import LISTENS
from .intake import Wanted, owner_of, taken_in
from .job_book import Entry, NotDoneError
from .leaving import unless_gone
from .parameters import Parameters
from .result_room import result_folder
from .server_timing import server_timing
from .service import Service

# How often the page of a running job is looked at, and how long a stream may be silent.
LOOK_SECONDS = 0.25
SILENT_SECONDS = 15.0
# How long after a job's end a shutdown waits for somebody to fetch its result.
FETCH_SECONDS = 10.0

log = logging.getLogger("pns.service")


def router(service: Service) -> APIRouter:
    """Make the routes, bound to one service."""
    routes = APIRouter(tags=["jobs"])

    @routes.post("/jobs", status_code=202, **documentation.JOBS)
    async def create_job(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        entry = await _hand_in(service, request, parameters)
        # Relative to /jobs, so that it holds under any root path.
        headers = {"Location": f"{request.scope.get('root_path', '')}/jobs/{entry.job.id}"}
        return JSONResponse(job_json(service, entry.job), 202, headers=headers)

    @routes.get("/jobs/{job_id}", **documentation.JOB)
    async def read_job(request: Request, job_id: str) -> Response:
        entry = _entry(service, request, job_id)
        return JSONResponse(job_json(service, entry.job), headers={"Cache-Control": "no-store"})

    @routes.get("/jobs/{job_id}/events", response_class=StreamingResponse, **documentation.EVENTS)
    async def read_job_events(request: Request, job_id: str) -> Response:
        entry = _entry(service, request, job_id)
        # Whoever follows a job can ask again: where connections run short, it gives way.
        request.scope.get("extensions", {}).get(LISTENS, bool)()
        return StreamingResponse(
            _events(service, entry.job),
            media_type="text/event-stream",
            # A proxy that collects the stream (nginx) would keep it until its end.
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )

    @routes.get("/jobs/{job_id}/result", response_class=Response, **documentation.RESULT)
    async def read_job_result(request: Request, job_id: str) -> Response:
        job = _entry(service, request, job_id).job
        kind = answer_type(request, media.MEDIA_TYPES[job.work.target])
        return _result(service, request, job_id, kind)

    @routes.get("/jobs/{job_id}/report", response_class=Response, **documentation.JOB_REPORT)
    async def read_job_report(request: Request, job_id: str) -> Response:
        return _result(service, request, job_id, media.JSON)

    @routes.delete("/jobs/{job_id}", status_code=204, **documentation.DELETE_JOB)
    async def delete_job(request: Request, job_id: str) -> Response:
        entry = _entry(service, request, job_id)
        if entry.job.state.ended:
            service.book.forget(job_id)
        elif entry.task is not None:
            entry.task.cancel()
            await asyncio.wait({entry.task})
        return Response(status_code=204)

    return routes


def job_json(service: Service, job: Job) -> dict[str, Any]:
    """Return a job as its client sees it."""
    queued = job.state is State.QUEUED
    estimate = service.desk.remaining(job)
    problem = None
    if job.error is not None:
        # By the id of the request that handed it in: what the log says of it stands under that.
        problem = json.loads(bytes(problems.of_job(job.error).body))
        problem["request_id"] = job.work.request_id
    return {
        "id": job.id,
        "state": str(job.state),
        "queue_place": service.desk.place(job) if queued else None,
        "stage": job.page.stage if job.state is State.RUNNING else None,
        "share": round(job.share, 4),
        "estimate_seconds": None if estimate is None else round(estimate, 1),
        "faces": None if job.cost is None else job.cost.faces,
        "problem": problem,
    }


async def _hand_in(service: Service, request: Request, parameters: Parameters) -> Entry:
    """Take a file in, and its job until it stands in line.

    Raises:
        ServiceError: it is refused; ClientDisconnect: its client has left before that.
    """
    settings = service.settings
    wanted = Wanted(
        answer=True,
        report=True,
        folder=result_folder(settings),
        patience=settings.queue_seconds + settings.job_seconds,
    )
    client = client_of(request, settings)
    service.book.check_room(client.networks)
    async with AsyncExitStack() as held:
        job = await held.enter_async_context(taken_in(service, request, parameters, wanted))
        entry = service.book.add(job, owner_of(client), client.networks)
        entry.task = asyncio.create_task(_work(service, job, held.pop_all()))
    try:
        await unless_gone(request.receive, job.accepted.wait())
    except ClientDisconnect:
        # Nobody knows its id. Nothing else would bound how many such jobs wait to be measured.
        service.book.forget(job.id)
        raise
    if job.error is not None and job.waiting is None:
        # Refused before it stood in line: there is nothing to come back for.
        service.book.forget(job.id)
        raise job.error
    return entry


async def _work(service: Service, job: Job, held: AsyncExitStack) -> None:
    """Do a job that no connection waits for, to its end, and be under way until it is fetched."""
    async with held:
        try:
            async with service.admission.working():
                await service.desk.serve(job)
        except DrainingError:
            pass
        except ServiceError as error:
            log.info("a job failed: %s", error.code)
        except JobFaultError as error:
            # The traceback that matters is the worker's.
            log.error("a job failed in its worker:\n%s", error)  # noqa: TRY400
        finally:
            service.book.keep(job)
    if job.state is State.DONE:
        # Who asks now and then whether it is done may not have asked since.
        with suppress(TimeoutError, DrainingError):
            async with service.admission.working(), asyncio.timeout(FETCH_SECONDS):
                await job.fetched.wait()


async def _events(service: Service, job: Job) -> AsyncIterator[str]:
    """Yield the job as server-sent events, one for each change, until it has ended."""
    said, silent = "", 0.0
    while True:
        ended = job.state.ended
        now = json.dumps(job_json(service, job), separators=(",", ":"))
        if now != said:
            said, silent = now, 0.0
            yield f"event: progress\ndata: {now}\n\n"
        elif silent >= SILENT_SECONDS:
            silent = 0.0
            yield ": still there\n\n"
        if ended:
            return
        try:
            async with asyncio.timeout(LOOK_SECONDS):
                await job.ended.wait()
        except TimeoutError:
            silent += LOOK_SECONDS


def _result(service: Service, request: Request, job_id: str, kind: str) -> Response:
    job = _entry(service, request, job_id).job
    if job.state is State.FAILED and job.error is not None:
        return problems.of_job(job.error)
    if job.state is not State.DONE:
        raise NotDoneError(f"the job is {job.state}")
    answer, report = job.results
    file = report if kind == media.JSON else answer
    file.hold()
    sent = job.fetched.set if file is answer else lambda: None
    held = ExitStack()
    held.callback(file.release)
    return FileAnswer(
        file,
        held,
        service.admission,
        client_of(request, service.settings).id,
        media_type=kind,
        headers={
            "Server-Timing": server_timing(job.seconds),
            "Vary": "Accept",
            "Cache-Control": "no-store",
        },
        sent=sent,
    )


def _entry(service: Service, request: Request, job_id: str) -> Entry:
    return service.book.find(job_id, client_of(request, service.settings).id)
