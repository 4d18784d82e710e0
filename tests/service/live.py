"""A real server on a free loopback port, in a thread of the test's process."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

from service.app import create_app
from service.settings import Settings
from tests.service import stand_in_jobs as jobs


@contextmanager
def served(**settings: Any) -> Iterator[tuple[str, int]]:
    """Host and port of a server whose workers obey their request's body."""
    app = create_app(Settings(**settings), job=jobs.obey, warm_up=jobs.no_warm_up)
    config = uvicorn.Config(app, port=0, log_level="error", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield server.servers[0].sockets[0].getsockname()
    finally:
        server.should_exit = True
        thread.join()
