"""Jobs: hand in a file, come back for the result."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Coroutine
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
from .intake import Wanted, owner_of, taken_in
from .job_book import Entry, NotDoneError
from .job_store import ANSWER, REPORT
from .leaving import unless_gone
from .parameters import Parameters
from .result_room import result_folder
from .server_timing import server_timing
from .service import Service
from .shared_jobs import SharedJobs

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
        view = await _view(service, request, job_id)
        return JSONResponse(view, headers={"Cache-Control": "no-store"})

    @routes.get("/jobs/{job_id}/events", response_class=StreamingResponse, **documentation.EVENTS)
    async def read_job_events(request: Request, job_id: str) -> Response:
        await _view(service, request, job_id)
        return StreamingResponse(
            _events(service, request, job_id),
            media_type="text/event-stream",
            # A proxy that collects the stream (nginx) would keep it until its end.
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )

    @routes.get("/jobs/{job_id}/result", response_class=Response, **documentation.RESULT)
    async def read_job_result(request: Request, job_id: str) -> Response:
        kind = (await _view(service, request, job_id))["format"]
        file_type = answer_type(request, media.MEDIA_TYPES[kind])
        return await _result(service, request, job_id, file_type)

    @routes.get("/jobs/{job_id}/report", response_class=Response, **documentation.JOB_REPORT)
    async def read_job_report(request: Request, job_id: str) -> Response:
        return await _result(service, request, job_id, media.JSON)

    @routes.delete("/jobs/{job_id}", status_code=204, **documentation.DELETE_JOB)
    async def delete_job(request: Request, job_id: str) -> Response:
        await _delete(service, request, job_id)
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
        "format": job.work.target,
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
        if service.shared is not None:
            try:
                await service.shared.publish(job, entry.owner)
            except ServiceError:
                service.book.hand_over(job)
                raise
        entry.task = asyncio.create_task(_work(service, entry, held.pop_all()))
    try:
        await unless_gone(request.receive, job.accepted.wait())
    except ClientDisconnect:
        # Nobody knows its id. Nothing else would bound how many such jobs wait to be measured.
        entry.cancelled = True
        service.book.forget(job.id)
        raise
    if job.error is not None and job.waiting is None:
        # Refused before it stood in line: there is nothing to come back for.
        if service.shared is not None:
            await service.shared.store.delete(job.id)
        service.book.forget(job.id)
        raise job.error
    return entry


def begin_shared(service: Service, entry: Entry, held: AsyncExitStack) -> None:
    """Work on a job that another replica has left."""
    entry.task = asyncio.create_task(_work(service, entry, held))


async def _work(service: Service, entry: Entry, held: AsyncExitStack) -> None:
    """Do a job that no connection waits for, to its end, and be under way until it is fetched."""
    job, shared = entry.job, service.shared
    async with held:
        beats = None if shared is None else asyncio.create_task(shared.beat(entry))
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
            if beats is not None:
                beats.cancel()
            # Of jobs that are shared any replica has the result, from the store.
            if shared is not None and await _to_its_end(shared.end(entry)):
                service.book.hand_over(job)
            else:
                service.book.keep(job)
    if job.state is State.DONE and shared is None:
        # Who asks now and then whether it is done may not have asked since.
        with suppress(TimeoutError, DrainingError):
            async with service.admission.working(), asyncio.timeout(FETCH_SECONDS):
                await job.fetched.wait()


async def _to_its_end(work: Coroutine[Any, Any, bool]) -> bool:
    """Wait for a short piece of work, also in a task that is being cancelled."""
    task = asyncio.create_task(work)
    await asyncio.wait({task})
    return task.result()


async def _events(service: Service, request: Request, job_id: str) -> AsyncIterator[str]:
    """Yield the job as server-sent events, one for each change, until it has ended."""
    said, silent = "", 0.0
    while True:
        try:
            view = await _view(service, request, job_id)
        except ServiceError:
            # It is forgotten, or the store is away: who follows it asks again.
            return
        ended = State(view["state"]).ended
        now = json.dumps(view, separators=(",", ":"))
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
                if service.book.has(job_id):
                    await _entry(service, request, job_id).job.ended.wait()
                else:
                    await asyncio.sleep(LOOK_SECONDS)
        except TimeoutError:
            pass
        silent += LOOK_SECONDS


async def _view(service: Service, request: Request, job_id: str) -> dict[str, Any]:
    """Return a job as its client sees it, whichever replica works on it. Raises ServiceError."""
    if service.shared is None or service.book.has(job_id):
        return job_json(service, _entry(service, request, job_id).job)
    client = client_of(request, service.settings)
    return (await service.shared.find(job_id, client.id)).view


async def _delete(service: Service, request: Request, job_id: str) -> None:
    """Cancel a job, or forget one that has ended. Raises ServiceError."""
    shared = service.shared
    if shared is None or service.book.has(job_id):
        entry = _entry(service, request, job_id)
        ended = entry.job.state.ended
        if not ended and entry.task is not None:
            entry.cancelled = True
            entry.task.cancel()
            await asyncio.wait({entry.task})
            return
        service.book.forget(job_id)
    else:
        record = await shared.find(job_id, client_of(request, service.settings).id)
        ended = State(record.view["state"]).ended
    if shared is not None:
        await (shared.store.delete if ended else shared.store.cancel)(job_id)


async def _shared_result(
    shared: SharedJobs, service: Service, request: Request, job_id: str, kind: str
) -> Response:
    """Answer with the result of a job that another replica has done."""
    client = client_of(request, service.settings).id
    view = (await shared.find(job_id, client)).view
    if view["state"] == State.FAILED and view["problem"] is not None:
        return problems.ProblemResponse(view["problem"], view["problem"]["status"])
    if view["state"] != State.DONE:
        raise NotDoneError(f"the job is {view['state']}")
    file = await shared.file(REPORT if kind == media.JSON else ANSWER, job_id)
    held = ExitStack()
    held.callback(file.release)
    return FileAnswer(
        file,
        held,
        service.admission,
        client,
        stall_seconds=service.settings.stall_seconds,
        media_type=kind,
        headers={"Vary": "Accept", "Cache-Control": "no-store"},
    )


async def _result(service: Service, request: Request, job_id: str, kind: str) -> Response:
    if service.shared is not None and not service.book.has(job_id):
        return await _shared_result(service.shared, service, request, job_id, kind)
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
        stall_seconds=service.settings.stall_seconds,
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
