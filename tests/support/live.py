"""A real server on a free loopback port, in a thread of the test's process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fastapi.testclient import TestClient
from starlette.types import ASGIApp

from service.http.app import create_app
from service.http.server import Server, configuration
from service.settings import Settings
from service.workers.jobs import Done, Work
from tests.support import stand_in_jobs as jobs


def local(app: ASGIApp, **options: Any) -> TestClient:
    """A client in this process, of a service that listens on loopback."""
    return TestClient(app, **{"base_url": "http://localhost"} | options)


@contextmanager
def served(
    job: Callable[[Work], Done] = jobs.obey,
    warm_up: Callable[[Any], None] | None = jobs.no_warm_up,
    **settings: Any,
) -> Iterator[tuple[str, int]]:
    """Host and port of a server whose workers obey their request's body, or do another job."""
    chosen = Settings(**{"port": 0} | settings)
    app = create_app(chosen, job=job, warm_up=warm_up)
    server = Server(configuration(app, chosen))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield server.servers[0].sockets[0].getsockname()
    finally:
        server.should_exit = True
        thread.join()
