"""Jobs: hand in a file, come back for the result."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from ...bodies import media
from ...errors import ServiceError
from ...workers.job import State
from .. import documentation, problems
from ..answer import FileAnswer, answer_type, server_timing
from ..clients import client_of
from ..parameters import Parameters
from ..service import Service
from .book import NotDoneError
from .store import ANSWER, REPORT
from .work import hand_in, shown

# How often the page of a running job is looked at, and how long a stream may be silent.
LOOK_SECONDS = 0.25
SILENT_SECONDS = 15.0


def router(service: Service) -> APIRouter:
    """Make the routes, bound to one service."""
    routes = APIRouter(tags=["jobs"])
    turn = asyncio.Lock()

    @routes.post("/jobs", status_code=202, **documentation.JOBS)
    async def create_job(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        entry = await hand_in(service, request, parameters)
        # Relative to /jobs, so that it holds under any root path.
        headers = {"Location": f"{request.scope.get('root_path', '')}/jobs/{entry.job.id}"}
        return JSONResponse(shown(service, entry.job), 202, headers=headers)

    @routes.get("/jobs/{job_id}", **documentation.JOB)
    async def read_job(request: Request, job_id: str) -> Response:
        view = await _view(service, client(request), job_id)
        return JSONResponse(view, headers={"Cache-Control": "no-store"})

    @routes.get("/jobs/{job_id}/events", response_class=StreamingResponse, **documentation.EVENTS)
    async def read_job_events(request: Request, job_id: str) -> Response:
        await _view(service, client(request), job_id)
        return StreamingResponse(
            _events(service, client(request), job_id, turn),
            media_type="text/event-stream",
            # A proxy that collects the stream (nginx) would keep it until its end.
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )

    @routes.get("/jobs/{job_id}/result", response_class=Response, **documentation.RESULT)
    async def read_job_result(request: Request, job_id: str) -> Response:
        whose = client(request)
        view = await _view(service, whose, job_id)
        kind = answer_type(request, media.MEDIA_TYPES[view["format"]])
        return await _result(service, whose, job_id, view, kind)

    @routes.get("/jobs/{job_id}/report", response_class=Response, **documentation.JOB_REPORT)
    async def read_job_report(request: Request, job_id: str) -> Response:
        whose = client(request)
        view = await _view(service, whose, job_id)
        return await _result(service, whose, job_id, view, media.JSON)

    @routes.delete("/jobs/{job_id}", status_code=204, **documentation.DELETE_JOB)
    async def delete_job(request: Request, job_id: str) -> Response:
        await _delete(service, client(request), job_id)
        return Response(status_code=204)

    def client(request: Request) -> str:
        return client_of(request, service.settings).id

    return routes


async def _events(
    service: Service, client: str, job_id: str, turn: asyncio.Lock
) -> AsyncIterator[str]:
    """Yield the job as server-sent events, one for each change, until it has ended.

    All streams take turns: hundreds of one job wake at the same moment, and would hold the event
    loop together.
    """
    said, silent = "", 0.0
    while True:
        async with turn:
            await asyncio.sleep(0)
        try:
            view = await _view(service, client, job_id)
        except ServiceError:
            # It is forgotten, or the store is away: who follows it asks again.
            return
        now = json.dumps(view, separators=(",", ":"))
        if now != said:
            said, silent = now, 0.0
            yield f"event: progress\ndata: {now}\n\n"
        elif silent >= SILENT_SECONDS:
            silent = 0.0
            yield ": still there\n\n"
        if State(view["state"]).ended:
            return
        with suppress(TimeoutError):
            async with asyncio.timeout(LOOK_SECONDS):
                if service.shared is None and service.book.has(job_id):
                    await service.book.find(job_id, client).job.ended.wait()
                else:
                    await asyncio.sleep(LOOK_SECONDS)
        silent += LOOK_SECONDS


async def _view(service: Service, client: str, job_id: str) -> dict[str, Any]:
    """Return a job as its client sees it, whichever replica works on it. Raises ServiceError."""
    if service.shared is None or service.book.has(job_id):
        return shown(service, service.book.find(job_id, client).job)
    return (await service.shared.find(job_id, client)).view


async def _delete(service: Service, client: str, job_id: str) -> None:
    """Cancel a job, or forget one that has ended. Raises ServiceError."""
    shared = service.shared
    if shared is None or service.book.has(job_id):
        entry = service.book.find(job_id, client)
        ended = entry.job.state.ended
        if not ended and entry.task is not None:
            entry.cancelled = True
            entry.task.cancel()
            await asyncio.wait({entry.task})
            return
        service.book.forget(job_id)
    else:
        record = await shared.find(job_id, client)
        ended = State(record.view["state"]).ended
    if shared is not None:
        await (shared.store.delete if ended else shared.store.cancel)(job_id)


async def _result(
    service: Service, client: str, job_id: str, view: dict[str, Any], kind: str
) -> Response:
    """Answer with a file of a job, or the problem that it failed with. Raises ServiceError."""
    if view["state"] == State.FAILED and view["problem"] is not None:
        problem = view["problem"]
        # What failed a while ago for want of room may find some.
        headers = {"Retry-After": "1"} if problem["status"] == 503 else None
        return problems.ProblemResponse(problem, problem["status"], headers)
    if view["state"] != State.DONE:
        raise NotDoneError(f"the job is {view['state']}")
    sent, timing = (lambda: None), {}
    if service.shared is not None and not service.book.has(job_id):
        file = await service.shared.file(REPORT if kind == media.JSON else ANSWER, job_id)
        sent = partial(service.shared.fetched, job_id) if kind != media.JSON else sent
    else:
        job = service.book.find(job_id, client).job
        answer, report = job.results
        file = report if kind == media.JSON else answer
        file.hold()
        sent = job.fetched.set if file is answer else sent
        timing = {"Server-Timing": server_timing(job.seconds)}
    return FileAnswer(
        file,
        service.admission,
        client,
        stall_seconds=service.settings.stall_seconds,
        media_type=kind,
        headers=timing | {"Cache-Control": "no-store"},
        sent=sent,
    )
