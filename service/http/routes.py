"""The routes: a refined file, models, limits, and two probes for whoever runs the service."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack
from typing import Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field
from starlette.responses import Response

from pns_common.scheme_names import BASE_SCHEMES

from ..bodies import media
from ..errors import NoModelError
from ..settings import Settings
from ..workers.catalogue import ModelEntry
from ..workers.job import Job
from . import documentation
from .admission import DrainingError
from .answer import FileAnswer, answer_type, is_known, server_timing, unless_gone
from .clients import Client, client_of
from .intake import Wanted, taken_in
from .parameters import Parameters
from .service import Service

log = logging.getLogger("pns.service")


class Range(BaseModel):
    """From the least to the largest value, both allowed."""

    min: int
    max: int


class LimitsEntry(BaseModel):
    """The limits of this service."""

    body_bytes: int = Field(description="largest body")
    faces: int = Field(description="most faces predicted in an answer")
    faces_per_minute: float | None = Field(
        description="most faces that the client may ask for in a minute; null: no such limit"
    )
    levels: Range
    memory_bytes: int = Field(description="most memory predicted for one job")
    seconds: float = Field(description="longest job, and longest wait for `POST /subdivide`")
    queue_seconds: float = Field(description="longest wait of a job from `POST /jobs`")
    result_seconds: float = Field(description="how long the result of a job is kept")
    result_bytes: int = Field(description="what all results may take, and so each")
    formats: list[str] = Field(description="media types of bodies")
    schemes: list[str] = Field(description="base schemes that `scheme=` takes beside auto and pns")


def limits_of(settings: Settings, client: Client) -> LimitsEntry:
    """Return the limits that the settings set, and the budget of who asks."""
    return LimitsEntry(
        body_bytes=int(settings.body),
        faces=settings.faces,
        faces_per_minute=client.faces_per_minute,
        levels=Range(min=1, max=settings.levels),
        memory_bytes=int(settings.memory),
        seconds=settings.job_seconds,
        queue_seconds=settings.queue_seconds,
        result_seconds=settings.result_seconds,
        result_bytes=int(settings.result_bytes),
        formats=list(media.ACCEPTED),
        schemes=list(BASE_SCHEMES),
    )


def router(service: Service) -> APIRouter:
    """Make the routes, bound to one service."""
    routes = APIRouter()

    @routes.post("/subdivide", response_class=Response, **documentation.SUBDIVIDE)
    async def subdivide(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        file_type = media.MEDIA_TYPES[parameters.format]
        return await _subdivide(service, request, parameters, answer_type(request, file_type))

    @routes.post("/report", response_class=Response, **documentation.REPORT)
    async def report(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        return await _subdivide(service, request, parameters, media.JSON)

    @routes.get("/models", response_model=list[ModelEntry], **documentation.MODELS)
    async def models(request: Request) -> Response:
        catalogue = await service.models.get()
        # It may change when the service starts again, so a copy is asked for, and costs nothing.
        headers = {"ETag": catalogue.tag, "Cache-Control": "no-cache"}
        if is_known(catalogue.tag, request):
            return Response(status_code=304, headers=headers)
        return Response(catalogue.content, headers=headers, media_type=media.JSON)

    @routes.get("/limits", response_model=LimitsEntry, **documentation.LIMITS)
    async def limits(request: Request) -> LimitsEntry:
        return limits_of(service.settings, client_of(request, service.settings))

    @routes.get("/healthz", **documentation.HEALTHZ)
    async def healthz() -> dict[str, str]:
        return {"status": "ok"}

    @routes.get("/readyz", **documentation.READYZ)
    async def readyz() -> dict[str, str]:
        if service.admission.draining:
            raise DrainingError("no new request is taken", retry_after=5)
        if not service.desk.ready:
            raise NoModelError("no worker has loaded the model")
        return {"status": "ready"}

    return routes


async def _subdivide(
    service: Service, request: Request, parameters: Parameters, kind: str
) -> Response:
    """Do a job that its client waits for."""
    settings = service.settings
    report_only = kind == media.JSON
    wanted = Wanted(not report_only, report_only, folder=None, patience=settings.job_seconds)

    with ExitStack() as held:
        async with taken_in(service, request, parameters, wanted) as job:
            (answer,) = job.results
            held.enter_context(answer)
            async with service.admission.working():
                await unless_gone(request.receive, service.desk.serve(job))
        timing = job.seconds | {"total": job.upload_seconds + time.monotonic() - job.admitted}
        stages_text = server_timing(timing)
        _log(job, answer.size, stages_text)
        # From here on the file is the answer's.
        held.pop_all()
        return FileAnswer(
            answer,
            service.admission,
            job.client,
            stall_seconds=settings.stall_seconds,
            media_type=kind,
            headers={"Server-Timing": stages_text},
        )


def _log(job: Job, size: int, stages: str) -> None:
    options = job.work.options
    model = None if job.done is None else job.done.model
    what = options.scheme if model is None else f"{options.scheme} ({model})"
    log.info("%s levels=%d: %d bytes; %s", what, options.levels, size, stages)
