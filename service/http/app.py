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
from starlette.types import ASGIApp

from ..errors import ServiceError
from ..settings import Settings
from ..workers import jobs
from ..workers.budget import FacesBudget
from ..workers.catalogue import Catalogue
from ..workers.costs import Cost
from ..workers.desk import Desk
from ..workers.jobs import Done, Work
from ..workers.pool import Workers
from ..workers.turns import Lane, Turns
from . import layers, openapi, pages, problems, routes
from .access.keys import read_keys
from .access.origins import is_loopback
from .admission import Admission
from .jobs import routes as job_routes
from .jobs.book import JobBook
from .jobs.shared import SharedJobs
from .jobs.store import JobStore
from .room import BEYOND, connections_that_fit, with_results_that_fit
from .service import ReadOnce, Service
from .watch.metrics import Metrics
from .watch.tracing import tracer_from_environment

log = logging.getLogger("pns.service")

# How often a service that starts looks whether its workers are ready.
READY_SECONDS = 0.1

if TYPE_CHECKING:
    from pns_common.model.session import Model


def create_app(
    settings: Settings | None = None,
    model: Model | None = None,
    *,
    job: Callable[[Work], Done] = jobs.subdivide,
    measure: Callable[[Work], Cost] = jobs.measure,
    warm_up: Callable[[Model | str | None], None] | None = None,
    catalogue: Callable[[], Catalogue] = jobs.catalogue,
) -> FastAPI:
    """Create the application, with worker processes that live as long as its lifespan.

    `settings` None reads the environment; `model` None loads `settings.model`. `job` is what a
    worker calls for each job, `measure` what it calls to predict its cost, `warm_up` what it calls
    once, before (None: `jobs.warm_up`), `catalogue` what one of them calls once, later. A model
    that does not load leaves the service up: /readyz says 503, scheme=loop and the other models
    work. Raises KeysError where the file of keys cannot be used, TracingError where traces cannot
    be sent.
    """
    settings = with_results_that_fit(settings or Settings())
    most = connections_that_fit(settings)
    source = model if model is not None else settings.model
    warm = partial(warm_up or partial(jobs.warm_up, providers=settings.providers), source)
    workers = {
        Lane.ANY: Workers(settings.workers, settings.job_seconds, warm),
        Lane.SHORT: Workers(1, settings.job_seconds, warm),
    }
    desk = Desk(
        workers,
        Turns(settings.workers, settings.queue, settings.short_seconds),
        FacesBudget(),
        run=job,
        measure=measure,
        job_seconds=settings.job_seconds,
    )
    book = JobBook(
        seconds=settings.result_seconds,
        promised_seconds=min(settings.promised_seconds, settings.result_seconds),
        max_bytes=int(settings.result_bytes),
        max_jobs=settings.results,
    )
    admission = Admission(
        uploads=settings.uploads,
        body_bytes=settings.all_bodies,
        answer_bytes=int(settings.answer_bytes),
    )

    metrics = Metrics()
    _show(metrics, desk)
    tracer = tracer_from_environment()
    keys = None if settings.keys_file is None else read_keys(settings.keys_file)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        if keys is None and not is_loopback(settings.host):
            log.warning("open to everybody: no PNS_KEYS_FILE is set")
        elif keys is not None:
            log.info("open to the bearers of %d keys", len(keys))
        if not settings.proxies and not is_loopback(settings.host):
            log.warning(
                "no PNS_PROXIES are set: an address may connect and ask as often as it likes"
            )
        for pool in workers.values():
            pool.start()
        shared = service.shared
        beside = []
        if shared is not None:
            log.info("jobs are shared with other replicas; this one is %s", shared.store.replica)
            beside.append(asyncio.create_task(shared.adopt_for_ever()))
        if warm_up is None:
            # Stand-ins load no model.
            beside.append(asyncio.create_task(_tell_when_ready(service)))
        # A proxy sends requests to every replica whose port is open: they would wait for its model.
        while shared is not None and not (desk.ready or admission.draining):
            await asyncio.sleep(READY_SECONDS)
        try:
            yield
        finally:
            for task in beside:
                task.cancel()
            await book.close()
            if shared is not None:
                await shared.store.close()
            for pool in workers.values():
                await pool.stop()

    app = _Layered(
        title="PNS",
        summary="Subdivision surfaces with a small, bounded, learned correction",
        version=version("pns-subdivision"),
        servers=[{"url": settings.prefix or "/"}],
        lifespan=lifespan,
        # Else a slash too many is answered with whatever host the request names.
        redirect_slashes=False,
        docs_url=None,
        redoc_url=None,
        # Its spans would hold paths and queries; ours do not.
        telemetry={"tracing": False, "metrics": False, "logs": False},
        generate_unique_id_function=openapi.operation_id,
    )
    # Whoever names a route puts this before it; requests come without it.
    app.root_path = settings.prefix
    app.layers = lambda routes: layers.around(
        routes, settings, most + BEYOND, admission, metrics, keys, tracer
    )
    app.state.most = most
    app.state.admission = admission
    app.state.desk = desk
    app.state.metrics = metrics
    problems.install(app)
    models = ReadOnce(workers[Lane.SHORT], admission, catalogue, metrics.catalogue)
    service = Service(settings, desk, admission, models, book)
    if settings.store is not None:
        service.shared = SharedJobs(service, JobStore(settings))
    text = "Whether the store of jobs answers; 1 without one"
    metrics.gauge("pns_store_up", text, lambda: service.shared is None or service.shared.reached)
    text = "Results that are kept here, none with a store"
    metrics.gauge("pns_result_bytes", text, lambda: book.bytes)
    routers = [routes.router(service), job_routes.router(service), pages.router(settings.prefix)]
    for router in routers:
        app.include_router(router)
    # For the journal: what a layer refuses reaches none of them.
    app.state.routes = [route for router in routers for route in router.routes]
    app.openapi = openapi.described(app.openapi)  # type: ignore[method-assign]
    return app


async def _tell_when_ready(service: Service) -> None:
    """Log that the workers are ready, and read the models, which the metrics show."""
    while not service.desk.ready:
        await asyncio.sleep(READY_SECONDS)
    log.info("ready: %d workers have loaded the model", service.settings.workers + 1)
    with suppress(ServiceError):
        await service.models.get()


def _show(metrics: Metrics, desk: Desk) -> None:
    """Set what the metrics say of jobs."""
    desk.watchers.append(metrics.job)
    metrics.gauge("pns_jobs_waiting", "Jobs that wait", lambda: desk.waiting)
    metrics.gauge("pns_jobs_running", "Jobs that run or are measured", lambda: desk.running)
    metrics.tally("pns_worker_restarts", "Workers replaced", "cause", lambda: desk.restarts)


class _Layered(FastAPI):
    """An application whose layers are outside of everything, its handler of last resort too."""

    layers: Callable[[ASGIApp], ASGIApp]

    def build_middleware_stack(self) -> ASGIApp:
        return self.layers(super().build_middleware_stack())
