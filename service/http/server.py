"""`pns serve`: uvicorn with a shutdown that lets requests finish and says so beforehand."""

from __future__ import annotations

import asyncio
import errno
import gc
import logging
import os
import signal
import socket
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from types import FrameType
from typing import Any

import uvicorn
from fastapi import FastAPI

from .. import log_lines
from ..errors import NoModelError
from ..settings import Settings, StartError
from ..workers.jobs import hold_model
from ..workers.worker import give_back
from .access.origins import is_loopback
from .admission import Admission
from .app import create_app
from .watch.metrics import Metrics, scrapes

log = logging.getLogger("pns.service")

# After draining, what is still in the sockets' buffers may go out.
FLUSH_SECONDS = 2
# How long a replica that takes no connection any more takes requests on those that it has.
LAST_SECONDS = 1.0
# Connections that wait in the system, and that the event loop takes of them in a turn.
WAITING, A_TURN = 2048, 32
# The longest head: request line and headers together.
HEAD_BYTES = 16 * 1024
# Ticks, a tenth of a second each, between two times at which freed memory is given back.
GIVE_BACK_TICKS = 100
# Connections to the metrics.
MOST_SCRAPERS = 16
# Of uvicorn's settings, for the service and for its metrics.
ALIKE: dict[str, Any] = {
    # The other parser bounds no head.
    "http": "h11",
    "h11_max_incomplete_event_size": HEAD_BYTES,
    "ws": "none",
    "server_header": False,
    # Its loggers are configured with ours, and the journal says what an access log would.
    "log_config": None,
    "access_log": False,
    "timeout_graceful_shutdown": FLUSH_SECONDS,
}


class PromptServer(uvicorn.Server):
    """A server whose idle connections end in time.

    A connection is idle while it has no request under way: nothing was sent, or half a head, or it
    rests after an answer, or sends what nobody reads of a body. It ends `head_seconds` later; where
    there are more than `most` connections, those that are idle for longest end at once, but for
    those that rest between two requests: these end soon, as in a crowd an answer is the last on its
    connection. One whose client still takes its answer is idle once it takes none of it any more.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        head_seconds: float,
        most: int,
        listening: list[socket.socket] | None = None,
    ) -> None:
        super().__init__(config)
        self.listening = listening
        self._head_seconds = head_seconds
        self._most = most
        # By connection: since when it is idle, after which request, and what of its answer its
        # client has not taken yet, in bytes.
        self._idle: dict[Any, tuple[float, Any, int]] = {}

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals to another server of this process."""
        yield

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve on the sockets that it was made with, or as its configuration says."""
        await super().serve(sockets or self.listening)

    async def on_tick(self, counter: int) -> bool:
        """End idle connections, ten times a second."""
        self._end_idle(asyncio.get_running_loop().time())
        return await super().on_tick(counter)

    def _end_idle(self, now: float) -> None:
        connections = self.server_state.connections
        before, self._idle = self._idle, {}
        for connection in connections:
            cycle = _cycle_of(connection)
            closing = connection.transport.is_closing()
            if closing or cycle is None or cycle.response_complete or _answered(cycle):
                untaken = connection.transport.get_write_buffer_size()
                since, last, left = before.get(connection, (now, cycle, untaken))
                rests = last is cycle and left == untaken
                self._idle[connection] = (since if rests else now, cycle, untaken)
        too_many = len(connections) - self._most
        for connection in sorted(self._idle, key=lambda connection: self._idle[connection][0]):
            since, cycle, untaken = self._idle[connection]
            waited = now - since
            # One that has just come may have sent its head. One that rests, as a proxy keeps them,
            # may be sent a request at this moment, which would be lost with it.
            over = cycle is not None and cycle.response_complete and not cycle.more_body
            between = over and not untaken and not connection.conn.trailing_data[0]
            crowded = too_many > 0 and waited > 0 and not between
            if waited >= self._head_seconds or crowded:
                connection.transport.abort()
                too_many -= 1


def _cycle_of(connection: Any) -> Any:
    """Return the last request of a connection and its answer, as uvicorn's h11 keeps them."""
    return getattr(connection, "cycle", None)


def _answered(cycle: Any) -> bool:
    """Return whether the whole answer was sent, and its end only waits for the request's."""
    return cycle.scope["state"].get("answered", False)


class DrainingServer(PromptServer):
    """On a first signal it takes nothing new, and exits once no request is under way.

    Bodies that have not arrived whole by then are refused: they may never. Until it exits it still
    answers: /readyz and new requests with 503; uvicorn's own shutdown would close the socket at
    once. A second signal, and the deadline, end what is under way with 503.

    With a store other replicas answer for all that this one has, so it takes no connection any
    more: a proxy that is refused one asks another replica at once. What was on its way is served
    for a second before anything is refused.
    """

    def __init__(
        self, app: FastAPI, settings: Settings, beside: uvicorn.Server | None = None
    ) -> None:
        super().__init__(configuration(app, settings), settings.head_seconds, app.state.most)
        metrics: Metrics = app.state.metrics
        text, connections = "Open connections", self.server_state.connections
        metrics.gauge("pns_connections", text, lambda: len(connections))
        self._admission: Admission = app.state.admission
        self._drain_seconds = settings.drain_seconds
        self._shared = settings.store is not None
        self._beside = beside
        self._began: float | None = None
        self._signals = 0

    capture_signals = uvicorn.Server.capture_signals

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, with a longer queue than what is taken of it in a turn."""
        await super().startup(sockets)
        for server in self.servers:
            for listening in server.sockets:
                with listening.dup() as same:
                    same.listen(WAITING)
                # A line for people, who look for the address among log lines.
                if is_loopback(self.config.host):
                    at = f"[{self.config.host}]" if ":" in self.config.host else self.config.host
                    print(f"Open http://{at}:{listening.getsockname()[1]}", flush=True)

    async def serve(self, sockets: list[socket.socket] | None = None) -> None:
        """Serve, with another server beside this one for as long."""
        if self._beside is None:
            await super().serve(sockets)
            return
        async with asyncio.TaskGroup() as both:
            both.create_task(self._beside.serve())
            await super().serve(sockets)
            self._beside.should_exit = True

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Close the admission; uvicorn calls this as the signal handler."""
        # The next request on a connection would meet its end.
        self._admission.leaving = True
        self._signals += 1
        if not (self._shared and self.started) or self._signals > 1:
            self._admission.draining = True
        # The third is for a shutdown that hangs.
        self.force_exit = self._signals > 2

    def hang_up(self, sig: int, frame: FrameType | None) -> None:
        """Take the end of a terminal for one signal: a shell tells of it, then the system again."""
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        self.handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Decide, ten times a second, whether to exit; every ten seconds give freed memory back."""
        self._admission.crowded = len(self.server_state.connections) > self._most
        if counter % GIVE_BACK_TICKS == 0:
            give_back()
        if self._signals:
            now = asyncio.get_running_loop().time()
            if self._began is None:
                self._began = now
                self._begin_to_drain()
            late = now - self._began
            if self._shared and late >= LAST_SECONDS:
                self._admission.draining = True
            if self._admission.draining:
                self._admission.end_uploads()
                if self._signals > 1 or late >= self._drain_seconds:
                    self._admission.end()
                    self.should_exit = True
                if self._admission.admitted == 0:
                    self.should_exit = True
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Let what is in the buffers out; who has the answer and still sends ends meanwhile."""
        asyncio.get_running_loop().call_later(FLUSH_SECONDS / 2, self._end_answered)
        await super().shutdown(sockets)

    def _end_answered(self) -> None:
        for connection in tuple(self.server_state.connections):
            cycle = _cycle_of(connection)
            if cycle is not None and _answered(cycle):
                connection.transport.abort()

    def _begin_to_drain(self) -> None:
        log.info("draining: %d requests and jobs are under way", self._admission.admitted)
        if not self._shared:
            return
        for server in self.servers:
            server.close()
        for connection in tuple(self.server_state.connections):
            cycle = _cycle_of(connection)
            if cycle is not None and cycle.response_complete:
                # What is still to be sent is sent.
                connection.transport.close()


def serve(settings: Settings) -> None:
    """Serve until a signal comes. Raises StartError."""
    # Uvicorn says between its log lines alone that a port is taken.
    with _bound(settings.host, settings.port, "give another --host or --port"):
        check_model(settings)
        log_lines.configure()
        app = create_app(settings)
        server = DrainingServer(app, settings, metrics_server(app.state.metrics, settings))
    # Under nohup the signal stays ignored.
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        signal.signal(signal.SIGHUP, server.hang_up)
    # What is loaded stays: to search it for cycles again and again holds the event loop for tens of
    # milliseconds.
    gc.collect()
    gc.freeze()
    server.run()


def check_model(settings: Settings) -> None:
    """Load the served model where one is named. Raises StartError where it does not load."""
    if settings.model is None:
        return
    # This process is to load none.
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        try:
            pool.submit(hold_model, settings.model, settings.providers).result()
        except NoModelError as error:
            raise StartError(f"PNS_MODEL (or --model): {error.detail}") from error


def _bound(host: str, port: int, hint: str, what: str = "") -> socket.socket:
    """Take an address, and do not listen there yet. Raises StartError where it is taken.

    Who connected to a socket that listens would be cut off where it is closed.
    """
    bound = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
    except OSError as error:
        bound.close()
        number = error.errno or 0
        if number < 0:
            # Of getaddrinfo: the host is no address.
            raise StartError(f"{what}{error.strerror}: {host!r}; {hint}") from error
        reason = os.strerror(number)
        where = "" if what else f" at {host}:{port}"
        raise StartError(f"{what}{reason}{where}; {hint}") from error
    return bound


def metrics_server(metrics: Metrics, settings: Settings) -> PromptServer | None:
    """Return what serves the metrics, where they have a port. Raises StartError."""
    host, wanted = settings.metrics_host, settings.metrics_port
    if wanted is None:
        return None
    hint = "give a PNS_METRICS_PORT that is free, and not PNS_PORT"
    what = f"metrics on {host}:{wanted}: "
    if wanted and wanted == settings.port:
        raise StartError(f"{what}{os.strerror(errno.EADDRINUSE)}; {hint}")
    listening = _bound(host, wanted, hint, what)
    listening.listen()
    log.info("metrics on http://%s:%d/metrics", host, listening.getsockname()[1])
    config = uvicorn.Config(scrapes(metrics.registry), lifespan="off", proxy_headers=False, **ALIKE)
    return PromptServer(config, settings.head_seconds, MOST_SCRAPERS, [listening])


def configuration(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """Return uvicorn's settings."""
    return uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        proxy_headers=bool(settings.proxies),
        forwarded_allow_ips=[str(network) for network in settings.proxies],
        backlog=A_TURN,
        timeout_keep_alive=settings.keep_alive_seconds,  # pyright: ignore[reportArgumentType]
        **ALIKE,
    )
