"""`pns serve`: uvicorn, with its own limits."""

from __future__ import annotations

import errno
import gc
import logging
import os
import signal
import socket
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import uvicorn
from fastapi import FastAPI

from .. import log_lines
from ..errors import NoModelError
from ..settings import Settings, StartError
from ..workers.jobs import hold_model
from .access.origins import is_loopback
from .app import create_app

log = logging.getLogger("pns.service")

# The longest head: request line and headers together.
HEAD_BYTES = 16 * 1024


class Server(uvicorn.Server):
    """Uvicorn, which prints its address for people, who look for it among log lines."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen."""
        await super().startup(sockets)
        host, port = self.config.host, self.servers[0].sockets[0].getsockname()[1]
        if is_loopback(host):
            at = f"[{host}]" if ":" in host else host
            print(f"Open http://{at}:{port}", flush=True)


def serve(settings: Settings) -> None:
    """Serve until a signal comes, and then until what is under way has ended. Raises StartError."""
    # Uvicorn says between its log lines alone that a port is taken.
    with _bound(settings):
        check_model(settings)
        log_lines.configure()
        app = create_app(settings)
        if settings.metrics_port is not None:
            own = settings.metrics_host, settings.metrics_port
            serve_metrics(app, *own, of_service=settings.port)
    # What is loaded stays: to search it for cycles again and again holds the event loop for tens of
    # milliseconds.
    gc.collect()
    gc.freeze()
    for number in (signal.SIGTERM, signal.SIGINT):
        # Uvicorn takes the signal, ends in order, and then sends it again.
        signal.signal(number, lambda *_: sys.exit(0))
    Server(configuration(app, settings)).run()


def serve_metrics(app: FastAPI, host: str, port: int, of_service: int) -> None:
    """Serve the metrics on a port that is not the service's own. Raises StartError."""
    hint = "give a PNS_METRICS_PORT that is free, and not PNS_PORT"
    if port and port == of_service:
        raise StartError(f"metrics on {host}:{port}: {os.strerror(errno.EADDRINUSE)}; {hint}")
    try:
        port = app.state.metrics.serve(host, port)
    except OSError as error:
        raise StartError(f"metrics on {host}:{port}: {error.strerror}; {hint}") from error
    log.info("metrics on http://%s:%d/metrics", host, port)


def _bound(settings: Settings) -> socket.socket:
    """Take the address, and do not listen there yet. Raises StartError where it is taken.

    Who connected to a socket that listens would wait until the service has started.
    """
    host, port = settings.host, settings.port
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
    except OSError as error:
        bound.close()
        hint = "give another --host or --port"
        raise StartError(f"{error.strerror} at {host}:{port}; {hint}") from error
    return bound


def check_model(settings: Settings) -> None:
    """Load the served model if it or its providers are named. Raises StartError."""
    if not settings.model_fields_set & {"model", "providers"}:
        return
    # This process is to load none.
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        try:
            pool.submit(hold_model, settings.model, settings.providers).result()
        except NoModelError as error:
            named = "PNS_PROVIDERS" if settings.model is None else "PNS_MODEL (or --model)"
            raise StartError(f"{named}: {error.detail}") from error


def configuration(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """Return uvicorn's settings."""
    return uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        proxy_headers=bool(settings.proxies),
        forwarded_allow_ips=[str(network) for network in settings.proxies],
        limit_concurrency=settings.connections,
        timeout_keep_alive=settings.keep_alive_seconds,
        timeout_graceful_shutdown=settings.drain_seconds,
        # The other parser bounds no head.
        http="h11",
        h11_max_incomplete_event_size=HEAD_BYTES,
        ws="none",
        server_header=False,
        # Its loggers are configured with ours, and the journal says what an access log would.
        log_config=None,
        access_log=False,
    )
