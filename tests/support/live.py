"""A real server on a free loopback port, in a thread of the test's process."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from fastapi.testclient import TestClient
from starlette.types import ASGIApp

from service.http.app import create_app
from service.http.server import Server, configuration
from service.settings import Settings
from service.workers.jobs import Done, Work
from tests.support import stand_in_jobs as jobs

GLB = {"Content-Type": "model/gltf-binary"}
# Seconds: only what hangs takes as long.
HANGS = 300


def local(app: ASGIApp, **options: Any) -> TestClient:
    """A client in this process, of a service that listens on loopback."""
    return TestClient(app, **{"base_url": "http://localhost"} | options)


def obeying(**settings: Any) -> TestClient:
    """A client in this process, of a service whose workers obey their request's body."""
    chosen = Settings(**{"workers": 1} | settings)
    app = create_app(chosen, job=jobs.obey, warm_up=jobs.no_warm_up)
    return local(app, raise_server_exceptions=False)


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


def until(holds: Callable[[], object]) -> None:
    end = time.monotonic() + HANGS
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


def request_head(*lines: str, target: str = "POST /subdivide") -> bytes:
    first = (f"{target} HTTP/1.1", "Host: localhost", "Content-Type: model/gltf-binary")
    return "\r\n".join([*first, *lines, "", ""]).encode()


def received(connection: socket.socket) -> bytes:
    """All that the server sends before it ends the connection."""
    pieces: list[bytes] = []
    with suppress(ConnectionResetError):
        pieces.extend(iter(lambda: connection.recv(2**16), b""))
    return b"".join(pieces)
