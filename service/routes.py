"""The routes: a refined file, the models, and two probes for whoever runs the service."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Query, Request
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response
from starlette.types import Receive

from service import documentation, media
from service.answer import FileAnswer
from service.catalogue import ModelEntry, ReadOnce
from service.errors import InvalidParameter, MediaTypeError, NoModelError, check_limit
from service.gate import DrainingError, Gate
from service.jobs import Done, Work
from service.memory_file import MemoryFile
from service.parameters import Parameters
from service.pool import Workers
from service.settings import Settings

log = logging.getLogger("pns.service")

T = TypeVar("T")
Job = Callable[[Work], Done]


@dataclass(frozen=True)
class Service:
    """What the routes share."""

    settings: Settings
    job: Job
    workers: Workers
    gate: Gate
    models: ReadOnce


def router(service: Service) -> APIRouter:
    """The routes, bound to one service."""
    routes = APIRouter()

    @routes.post("/subdivide", response_class=Response, **documentation.SUBDIVIDE)
    async def subdivide(request: Request, parameters: Annotated[Parameters, Query()]) -> Response:
        return await _subdivide(service, request, parameters)

    @routes.get("/models", response_model=list[ModelEntry], **documentation.MODELS)
    async def models(request: Request) -> Response:
        catalogue = await service.models.get()
        # It may change when the service starts again, so a copy is asked for, and costs nothing.
        headers = {"ETag": catalogue.tag, "Cache-Control": "no-cache"}
        if catalogue.is_known(request.headers.get("if-none-match", "")):
            return Response(status_code=304, headers=headers)
        return Response(catalogue.content, headers=headers, media_type=media.JSON)

    @routes.get("/healthz", **documentation.HEALTHZ)
    async def healthz() -> dict[str, str]:
        return {"status": "ok"}

    @routes.get("/readyz", **documentation.READYZ)
    async def readyz() -> JSONResponse:
        if service.gate.draining:
            raise DrainingError("no new request is taken", retry_after=5)
        if not service.workers.ready:
            raise NoModelError("no worker has loaded the model")
        return JSONResponse({"status": "ready"})

    return routes


async def _subdivide(service: Service, request: Request, parameters: Parameters) -> Response:
    settings = service.settings
    _refuse_repeated(request)
    options = parameters.options()
    await service.models.check(parameters.model)
    check_limit("levels", options.levels, settings.levels, f"levels is {options.levels}")
    content_type = request.headers.get("content-type", "")
    media.of_request(content_type)
    if request.headers.get("content-encoding", "identity").lower() != "identity":
        raise MediaTypeError("a compressed body (Content-Encoding) is not supported")
    accept = request.headers.get("accept", "*/*")
    report_only = media.quality(media.JSON, accept) > media.quality(media.GLB, accept)

    gate = service.gate
    with ExitStack() as held:
        # The body's memory is given back before the answer is sent; the answer's, after.
        with gate.body() as grow, MemoryFile() as body:
            began = time.perf_counter()
            async with gate.upload():
                async for piece in request.stream():
                    grow(len(piece))
                    body.append(piece)
            uploaded = time.perf_counter()
            held.enter_context(gate.job())
            answer = held.enter_context(MemoryFile())
            work = Work(
                body=body.path,
                answer=answer.path,
                content_type=content_type,
                report_only=report_only,
                options=options,
                model=parameters.model,
                limits=settings.job_limits(),
            )
            async with gate.working():
                done = await _unless_gone(request.receive, service.workers.run(service.job, work))
            finished = time.perf_counter()
        timing = {"upload": uploaded - began, **done.seconds, "total": finished - began}
        stages_text = _server_timing(timing)
        what = options.scheme if done.model is None else f"{options.scheme} ({done.model})"
        size = answer.size
        log.info("%s levels=%d: %d bytes; %s", what, options.levels, size, stages_text)
        return FileAnswer(
            answer,
            held.pop_all(),
            gate,
            media_type=media.JSON if report_only else media.GLB,
            headers={"Server-Timing": stages_text, "Vary": "Accept"},
            stall_seconds=settings.stall_seconds,
        )


def _refuse_repeated(request: Request) -> None:
    """Of a parameter that is given twice, one value would be lost without a word."""
    given = Counter(name for name, _ in request.query_params.multi_items())
    for name, count in given.items():
        if count > 1:
            raise InvalidParameter(name, f"{name} is given {count} times")


def _server_timing(seconds: dict[str, float]) -> str:
    return ", ".join(f"{stage};dur={1000 * value:.1f}" for stage, value in seconds.items())


async def _unless_gone(receive: Receive, work: Coroutine[Any, Any, T]) -> T:
    """The value of `work`, cancelled when the client disconnects. Raises ClientDisconnect."""
    job = asyncio.create_task(work)
    gone = asyncio.create_task(_disconnected(receive))
    try:
        await asyncio.wait({job, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not job.done():
            raise ClientDisconnect
        return job.result()
    finally:
        job.cancel()
        gone.cancel()
        await asyncio.gather(job, gone, return_exceptions=True)


async def _disconnected(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
