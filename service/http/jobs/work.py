"""The work of a job that no connection waits for: taken in, shared, done, kept."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Coroutine
from contextlib import AsyncExitStack, suppress
from typing import Any

from fastapi import Request
from starlette.requests import ClientDisconnect

from ...errors import ServiceError
from ...workers.job import Job, State
from ...workers.worker import JobFaultError
from .. import problems
from ..admission import DrainingError
from ..answer import unless_gone
from ..clients import client_of
from ..intake import Wanted, taken_in
from ..parameters import Parameters
from ..room import result_folder
from ..service import Service
from .book import Entry

# How long after a job's end a shutdown waits for somebody to fetch its result.
FETCH_SECONDS = 10.0

log = logging.getLogger("pns.service")


def job_json(service: Service, job: Job) -> dict[str, Any]:
    """Return a job as its client sees it."""
    queued = job.state is State.QUEUED
    estimate = service.desk.remaining(job)
    return {
        "id": job.id,
        "state": str(job.state),
        "queue_place": service.desk.place(job) if queued else None,
        "stage": job.page.stage if job.state is State.RUNNING else None,
        "share": round(job.share, 4),
        "estimate_seconds": None if estimate is None else round(estimate, 1),
        "faces": None if job.cost is None else job.cost.faces,
        "format": job.work.target,
        "problem": job.error and problems.of_job_view(job.error, job.work.request_id),
    }


def shown(service: Service, job: Job) -> dict[str, Any]:
    """Return a job as clients see it here.

    One that replicas share runs until its end is stored: what one shows, each of them shows.
    """
    view = job_json(service, job)
    if service.shared is not None and job.state.ended:
        view |= {"state": str(State.RUNNING), "problem": None}
    return view


async def hand_in(service: Service, request: Request, parameters: Parameters) -> Entry:
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
    if service.shared is None:
        service.book.check_room(client.networks)
    else:
        await service.shared.check_room(client.networks)
    async with AsyncExitStack() as held:
        job = await held.enter_async_context(taken_in(service, request, parameters, wanted))
        # Of whoever has no key, everybody who knows a job's id may see it.
        owner = client.id if client.named else None
        entry = service.book.add(job, owner, client.networks)
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
        beats = shared and asyncio.create_task(shared.beat(entry))
        try:
            async with service.admission.working():
                await service.desk.serve(job)
        except ServiceError:
            pass
        except JobFaultError as error:
            # The traceback that matters is the worker's.
            log.error("a job failed in its worker:\n%s", error)  # noqa: TRY400
        finally:
            size = sum(file.size for file in job.results)
            if shared is None:
                service.book.keep(job)
            else:
                await _to_its_end(_stored(service, entry))
            if beats is not None:
                beats.cancel()
            log.info("a job has ended", extra=_told(job, size))
    if job.state is State.DONE and shared is None:
        # Who asks now and then whether it is done may not have asked since.
        with suppress(TimeoutError, DrainingError):
            async with service.admission.working(), asyncio.timeout(FETCH_SECONDS):
                await job.fetched.wait()


async def _stored(service: Service, entry: Entry) -> None:
    """Have the end of a job stored: then any replica has it, and this one lets go of it."""
    try:
        if service.shared is not None:
            await service.shared.end(entry)
    finally:
        service.book.hand_over(entry.job)


async def _to_its_end(work: Coroutine[Any, Any, None]) -> None:
    """Wait for a piece of work, also in a task that is being cancelled."""
    task = asyncio.create_task(work)
    while not task.done():
        with suppress(asyncio.CancelledError):
            await asyncio.wait({task})
    task.result()


def _told(job: Job, size: int) -> dict[str, Any]:
    """Return what the log says of a job that has ended, under the id of its request."""
    fields = {
        "state": str(job.state),
        "client": job.client,
        "seconds": round(time.monotonic() - job.admitted, 3),
        "bytes": size,
        "code": getattr(job.error, "code", ""),
    }
    return {"fields": fields, "request_id": job.work.request_id}
