"""`pns serve`: uvicorn with a shutdown that lets requests finish and says so beforehand."""

from __future__ import annotations

import asyncio
import logging
from types import FrameType

import uvicorn

from service.app import create_app
from service.gate import Gate
from service.settings import Settings

# After draining, what is still in the sockets' buffers may go out.
FLUSH_SECONDS = 2


class DrainingServer(uvicorn.Server):
    """On the first SIGTERM or SIGINT it closes the gate; it exits once no request is under way.

    Bodies that have not arrived whole by then are refused: they may never. Until it exits it still
    answers: /readyz and new requests with 503; uvicorn's own shutdown would close the socket at
    once. A second signal, and the deadline, end what is under way with 503.
    """

    def __init__(self, config: uvicorn.Config, gate: Gate, drain_seconds: float) -> None:
        super().__init__(config)
        self._gate = gate
        self._drain_seconds = drain_seconds
        self._deadline: float | None = None
        self._signals = 0

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Close the gate; uvicorn calls this as the signal handler."""
        self._signals += 1
        self._gate.draining = True
        # The third is for a shutdown that hangs.
        self.force_exit = self._signals > 2

    async def on_tick(self, counter: int) -> bool:
        """Decide, ten times a second, whether to exit."""
        if self._gate.draining:
            now = asyncio.get_running_loop().time()
            self._deadline = self._deadline or now + self._drain_seconds
            self._gate.end_uploads()
            if self._signals > 1 or now >= self._deadline:
                self._gate.end()
                self.should_exit = True
            if self._gate.admitted == 0:
                self.should_exit = True
        return await super().on_tick(counter)


def serve(settings: Settings) -> None:
    """Serve until a signal comes."""
    # uvicorn configures its own loggers only; this one is for the service's lines.
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s:     %(message)s")
    logging.getLogger("pns").setLevel(logging.INFO)
    app = create_app(settings)
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        server_header=False,
        timeout_graceful_shutdown=FLUSH_SECONDS,
    )
    DrainingServer(config, app.state.gate, settings.drain_seconds).run()
