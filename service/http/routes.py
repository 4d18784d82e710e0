"""The routes: a refined file, models, limits, and two probes for whoever runs the service."""

from __future__ import annotations

from contextlib import AsyncExitStack
from typing import Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field
from starlette.responses import Response

from pns_common.scheme_names import BASE_SCHEMES

from ..bodies import media
from ..errors import NoModelError
from ..workers.models import ModelEntry
from . import openapi
from .access.clients import client_of
from .answer import answer_type, file_answer, is_known, stream_answer, unless_gone
from .jobs import Service
from .parameters import Parameters


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
    seconds: float = Field(description="longest job, and longest wait for a worker")
    requests: int = Field(description="most requests that the client may have under way")
    formats: list[str] = Field(description="media types of bodies")
    schemes: list[str] = Field(description="base schemes that `scheme=` takes beside auto and pns")


def router(service: Service) -> APIRouter:
    """Make the routes, bound to one service."""
    routes = APIRouter()

    @routes.post("/subdivide", response_class=Response, **openapi.SUBDIVIDE)
    async def subdivide(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        file_type = media.MEDIA_TYPES[parameters.format]
        return await _subdivide(service, request, parameters, answer_type(request, file_type))

    @routes.post("/report", response_class=Response, **openapi.REPORT)
    async def report(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        return await _subdivide(service, request, parameters, media.JSON)

    @routes.get("/models", response_model=list[ModelEntry], **openapi.MODELS)
    async def models(request: Request) -> Response:
        catalogue = await service.catalogue()
        # It may change when the service starts again, so a copy is asked for, and costs nothing.
        headers = {"ETag": catalogue.tag, "Cache-Control": "no-cache"}
        if is_known(catalogue.tag, request):
            return Response(status_code=304, headers=headers)
        return Response(catalogue.content, headers=headers, media_type=media.JSON)

    @routes.get("/limits", summary="What a request may ask for")
    async def limits(request: Request) -> LimitsEntry:
        settings = service.settings
        return LimitsEntry(
            body_bytes=int(settings.body),
            faces=settings.faces,
            faces_per_minute=client_of(request, settings).faces_per_minute,
            levels=Range(min=1, max=settings.levels),
            memory_bytes=int(settings.memory),
            seconds=settings.job_seconds,
            requests=settings.client_requests,
            formats=list(media.ACCEPTED),
            schemes=list(BASE_SCHEMES),
        )

    @routes.get("/healthz", tags=[openapi.PROBES], summary="Whether the process answers")
    async def healthz() -> dict[str, str]:
        return {"status": "ok"}

    @routes.get("/readyz", **openapi.READYZ)
    async def readyz() -> dict[str, str]:
        if not service.workers.ready:
            raise NoModelError("no worker has loaded the model")
        return {"status": "ready"}

    return routes


async def _subdivide(
    service: Service, request: Request, parameters: Parameters, kind: str
) -> Response:
    """Do a job that its client waits for, and where it is to be a stream tell how far it is."""
    is_stream, is_report = kind == media.MIXED, kind == media.JSON
    async with AsyncExitStack() as held:
        taking = service.received(
            request, parameters, answer=not is_report, report=is_report or is_stream
        )
        job = await held.enter_async_context(taking)
        if is_stream:
            file_type = media.MEDIA_TYPES[parameters.format]
            return stream_answer(service, job, held.pop_all(), file_type, request)
        await unless_gone(request.receive, service.serve(job))
        file = job.report if is_report else job.answer
        return file_answer(service, job, held.pop_all(), kind, file)
