"""The HTTP application."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

from fastapi import FastAPI
from fastapi.telemetry import TelemetryConfig
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

from ..errors import ServiceError
from ..settings import Settings
from ..workers import jobs
from ..workers.jobs import Done, Work
from ..workers.models import Catalogue
from ..workers.pool import Workers
from . import openapi, pages, problems, routes
from .access.keys import Bearer, Entry, read_keys
from .access.origins import Origins, is_loopback
from .jobs import Service
from .watch.journal import Journal
from .watch.metrics import Metrics
from .watch.tracing import provider_from_environment

if TYPE_CHECKING:
    from pns_common.model.session import Model

log = logging.getLogger("pns.service")

# How often a service that starts looks whether its workers are ready.
READY_SECONDS = 0.1
# What a page of another origin may send, beside what any may: all that is read here.
TAKEN = (
    *("Authorization", "Content-Encoding", "Content-Type", "If-None-Match"),
    *("Traceparent", "Tracestate", "X-Request-ID"),
)
# What it may read of an answer beside its body.
EXPOSED = ("ETag", "Retry-After", "Server-Timing", "X-Request-ID")


def create_app(
    settings: Settings | None = None,
    model: Model | None = None,
    *,
    job: Callable[[Work], Done] = jobs.subdivide,
    warm_up: Callable[[Model | str | None], None] | None = None,
    catalogue: Callable[[], Catalogue] = jobs.catalogue,
) -> FastAPI:
    """Create the application, with worker processes that live as long as its lifespan.

    `settings` None reads the environment; `model` None loads `settings.model`. `job` is what a
    worker calls for each job, `warm_up` what it calls once, before (None: `jobs.warm_up`),
    `catalogue` what one of them calls once, later. A model that does not load leaves the service
    up: /readyz says 503, scheme=loop and the other models work. Raises KeysError where the file of
    keys cannot be used, TracingError where traces cannot be sent.
    """
    settings = settings or Settings()
    source = model if model is not None else settings.model
    warm = partial(warm_up or partial(jobs.warm_up, providers=settings.providers), source)
    metrics = Metrics()
    workers = Workers(settings.workers, settings.job_seconds, warm, metrics.restart)
    service = Service(settings, workers, job, catalogue, metrics.job, metrics.catalogue)
    metrics.gauge("pns_requests_held", "Requests under way", lambda: service.places.taken.total())
    metrics.gauge("pns_jobs_waiting", "Jobs that wait", lambda: workers.waiting)
    metrics.gauge("pns_jobs_running", "Jobs that run or end", lambda: workers.held.total())
    tracers = provider_from_environment()
    keys = None if settings.keys_file is None else read_keys(settings.keys_file)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        if keys is not None:
            log.info("open to the bearers of %d keys", len(keys))
        elif not is_loopback(settings.host):
            log.warning("open to everybody: no PNS_KEYS_FILE is set")
        if not is_loopback(settings.host):
            if not settings.hosts:
                log.warning("asked by address alone: no PNS_HOSTS are set")
            if not settings.proxies:
                log.warning("no PNS_PROXIES are set: without a proxy it is for a trusted network")
        workers.start()
        # Stand-ins load no model.
        told = asyncio.create_task(_tell_when_ready(service)) if warm_up is None else None
        try:
            yield
        finally:
            if told is not None:
                told.cancel()
            await workers.stop()

    app = FastAPI(
        title="PNS",
        summary="Subdivision surfaces with a small, bounded, learned correction",
        version=version("pns-subdivision"),
        servers=[{"url": settings.prefix or "/"}],
        lifespan=lifespan,
        # Else a slash too many is answered with whatever host the request names.
        redirect_slashes=False,
        docs_url=None,
        redoc_url=None,
        telemetry=TelemetryConfig(
            tracing=tracers is not None,
            tracer_provider=tracers,
            metrics=False,
            logs=False,
            operation_spans=False,
        ),
        # The name of the function is the clients' name of an operation, too.
        generate_unique_id_function=lambda route: route.name,
        exception_handlers=problems.HANDLERS,
    )
    # Whoever names a route puts this before it; requests come without it.
    app.root_path = settings.prefix
    # Around everything, the handler of last resort too.
    stack = app.build_middleware_stack
    app.build_middleware_stack = lambda: around(stack(), settings, metrics, keys)  # type: ignore[method-assign]
    app.state.metrics = metrics
    app.state.service = service
    routers = [routes.router(service), pages.router(settings.prefix)]
    for router in routers:
        app.include_router(router)
    # For the journal: what a layer refuses reaches none of them.
    app.state.routes = [route for router in routers for route in router.routes]
    app.openapi = openapi.described(app.openapi)  # type: ignore[method-assign]
    return app


def around(
    routes: ASGIApp,
    settings: Settings,
    metrics: Metrics,
    keys: list[Entry] | None,
) -> ASGIApp:
    """Lay around the routes everything that is done for every request.

    `keys` None: it is open to everybody.
    """
    app = routes
    if keys is not None:
        app = problems.Checked(app, Bearer(keys).check)
    app = problems.Checked(app, Origins(settings).check)
    if settings.cors_origins:
        app = CORSMiddleware(
            app,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "POST"],
            allow_headers=TAKEN,
            expose_headers=EXPOSED,
        )
    app = Journal(app, metrics.request)

    async def requests(scope: Scope, receive: Receive, send: Send) -> None:
        await (app if scope["type"] == "http" else routes)(scope, receive, send)

    return requests


async def _tell_when_ready(service: Service) -> None:
    """Log that the workers are ready, and read the models, which the metrics show."""
    while not service.workers.ready:
        await asyncio.sleep(READY_SECONDS)
    log.info("ready: a worker has loaded the model")
    with suppress(ServiceError):
        await service.catalogue()
