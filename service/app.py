"""The HTTP application."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

from fastapi import FastAPI

from service import jobs, problems
from service.catalogue import Catalogue, ReadOnce
from service.gate import Gate
from service.limits import BodyLimit
from service.pool import Workers
from service.routes import Job, Service, router
from service.settings import Settings

if TYPE_CHECKING:
    from pns_common.schemes import Model


def create_app(
    settings: Settings | None = None,
    model: Model | None = None,
    *,
    job: Job = jobs.subdivide,
    warm_up: Callable[[Model | str | None], None] = jobs.warm_up,
    catalogue: Callable[[], Catalogue] = jobs.catalogue,
) -> FastAPI:
    """The application, with worker processes that live as long as its lifespan.

    `settings` None reads the environment; `model` None loads `settings.model`. `job` is what a
    worker calls for each request, `warm_up` what it calls once, before, `catalogue` what one of
    them calls once, later. A model that does not load leaves the service up: /readyz says 503,
    scheme=loop and the other models work.
    """
    settings = settings or Settings()
    source = model if model is not None else settings.model
    workers = Workers(settings.workers, settings.job_seconds, partial(warm_up, source))
    gate = Gate(
        jobs=settings.places,
        uploads=settings.uploads,
        body_bytes=settings.places * int(settings.body),
    )

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        workers.start()
        try:
            yield
        finally:
            await workers.stop()

    app = FastAPI(
        title="PNS",
        summary="Subdivision surfaces with a small, bounded, learned correction",
        version=version("pns"),
        lifespan=lifespan,
        redoc_url=None,
    )
    app.state.gate = gate
    problems.install(app)
    models = ReadOnce(workers, gate, catalogue)
    app.include_router(router(Service(settings, job, workers, gate, models)))
    app.add_middleware(
        BodyLimit,
        max_bytes=int(settings.body),
        seconds=settings.upload_seconds,
        idle_seconds=settings.idle_seconds,
    )
    return app
