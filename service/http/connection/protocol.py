"""One connection: uvicorn's HTTP/1.1 protocol, with deadlines, shares and an end that is heard."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from math import inf
from typing import Any

import h11
from starlette.types import Message, Receive, Scope, Send
from uvicorn.config import Config
from uvicorn.protocols.http.flow_control import CLOSE_HEADER, FlowControl
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from .crowd import LISTENS
from .deadline import Deadline
from .outlet import Outlet
from .parser import FLOODED, Parser
from .refusal import refusal
from .shared import READ_BYTES, Shared
from .taking import Taking

log = logging.getLogger("pns.connection")

# The longest head: request line and headers together.
HEAD_BYTES = 16 * 1024
# What is parsed in one go; a request of ordinary clients is two or three events.
EVENTS_A_TURN = 32
# What is written in one go: the transport copies what its client does not take, all of it.
WRITE_BYTES = 64 * 1024
# Neither an upload's rate nor an answer's is judged before.
RATE_SECONDS = 2.0


class _Flow(FlowControl):
    """Reading resumes only where nothing that was read waits for its turn."""

    held = False

    def resume_reading(self) -> None:
        if not self.held:
            super().resume_reading()


def _parts(message: Message) -> Iterator[Message]:
    """Yield a message as several of `WRITE_BYTES` each, where its body is longer."""
    body = memoryview(message.get("body", b""))
    while len(body) > WRITE_BYTES:
        yield {**message, "body": body[:WRITE_BYTES], "more_body": True}
        body = body[WRITE_BYTES:]
        message = {**message, "body": body}
    yield message


class BoundedProtocol(H11Protocol, asyncio.BufferedProtocol):
    """The protocol that `uvicorn.Config(http=…)` is given, bound to a `Shared`.

    What uvicorn does stays; on top of it:

    - a connection has a slot in the crowd or is refused with 503;
    - a head must arrive within its time, and an answer be taken at a least rate;
    - a body is parsed in short turns and may not come in countless pieces;
    - of an answer little is written before its client takes it, neither here nor by the system;
    - an answer given before the body is whole ends the connection, after it has been heard.
    """

    def __init__(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
        *,
        shared: Shared,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self.conn: Parser = Parser(config.h11_max_incomplete_event_size or HEAD_BYTES)
        self.app = self._application
        self._shared = shared
        self._has_slot = False
        self._head_deadline = Deadline(self.loop, self._head_is_late)
        self._end_deadline = Deadline(self.loop, self._abort)
        self._listens = False
        self._lingering = False
        self._linger_left = 0
        self._asked_at = self.loop.time()

    # The connection's life

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a slot, or refuse."""
        outlet = self._outlet = Outlet(transport, self._end)
        outlet.keep_little(self._shared.bounds.answer.idle)
        self._taking = Taking(outlet, self._shared.bounds.answer, self._abort)
        super().connection_made(outlet)  # type: ignore[arg-type]
        self.flow: _Flow = _Flow(outlet)  # type: ignore[arg-type]
        refusal = self._shared.crowd.enter(self, self._address)
        if refusal is not None:
            self._say(503, "too-many-connections", refusal, b"retry-after: 5\r\n")
            return
        self._has_slot = True
        self._await_head()

    @property
    def _address(self) -> str:
        return self.client[0] if self.client else ""

    def connection_lost(self, exc: Exception | None) -> None:
        """Give back whatever it held."""
        self._outlet.forget()
        self._taking.forget()
        self._head_deadline.stop()
        self._end_deadline.stop()
        self._shared.turns.remove(self._more)
        self._shared.crowd.leave(self)
        super().connection_lost(exc)
        self._unset_keepalive_if_required()

    def shutdown(self) -> None:
        """End it where it only lingers; else let uvicorn finish what is under way."""
        if self.transport.is_closing():
            self._abort()
        else:
            super().shutdown()

    # Reading

    def get_buffer(self, sizehint: int) -> bytearray:
        """Return where the next read goes."""
        return self._shared.buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Take what was read."""
        if self._lingering:
            self._linger_left -= nbytes
            if self._linger_left < 0:
                self._abort()
        elif not self.transport.is_closing():
            self._await_head()
            self.data_received(bytes(memoryview(self._shared.buffer)[:nbytes]))

    def handle_events(self) -> None:
        """Parse for one turn; what is left waits for the next."""
        self.conn.breathe(EVENTS_A_TURN)
        super().handle_events()
        if self.conn.their_state is not h11.IDLE:
            self._head_deadline.stop()
            self._say_to_crowd()
        if self.transport.is_closing():
            return
        if self.conn.flooded:
            self.flow.pause_reading()
            self.flow.held = True
            self.cycle.message_event.set()
        elif self.conn.out_of_breath:
            self.flow.pause_reading()
            self.flow.held = True
            self._shared.turns.add(self._more)

    def _more(self) -> None:
        """Take a turn: parse on, and read again where all is parsed."""
        if self.transport.is_closing():
            return
        self.flow.held = False
        self.handle_events()
        body_waits = self.cycle is not None and len(self.cycle.body) > READ_BYTES
        if not (self.flow.held or body_waits or self.conn.our_state is h11.DONE):
            self.flow.resume_reading()

    def _say_to_crowd(self) -> None:
        crowd, state = self._shared.crowd, self.conn.their_state
        goes = self.transport.is_closing()
        if self._listens:
            crowd.listen(self)
        elif self._taking.waits or (state is h11.SEND_BODY and not goes):
            crowd.attend(self)
        elif state is h11.IDLE and not goes:
            crowd.wait(self)
        else:
            crowd.work(self)

    def is_idle(self) -> bool:
        """Return whether its client said nothing: a head waiting in the socket is something."""
        return bool(self.conn.trailing_data[0]) or not self._outlet.has_unread

    def has_left(self) -> bool:
        """Return whether its client has ended what it sends."""
        return self._outlet.has_left

    def rate(self) -> float:
        """Return the bytes a second of its body or its answer."""
        if self._taking.waits:
            return self._taking.rate(RATE_SECONDS)
        seconds = self.loop.time() - self._asked_at
        return self.conn.body_bytes / seconds if seconds > RATE_SECONDS else inf

    def give_way(self) -> None:
        """End, for a new connection; a stream of events as if that were all."""
        if self._listens and self.conn.our_state is h11.SEND_BODY and not self._taking.waits:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
            self.transport.write(self.conn.send(h11.EndOfMessage()) or b"")
            self.transport.close()
        else:
            self._abort()

    def _listen(self) -> None:
        self._listens = True
        self._say_to_crowd()

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP; a body that stops being HTTP, too, where nothing is said yet."""
        if self.cycle is not None and not self.cycle.response_complete:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._say(self.conn.status_hint, "invalid-http", self.conn.complaint or msg)
        else:
            self.transport.close()

    def _unsupported_upgrade_warning(self) -> None:
        """Say nothing: anyone may ask, and it is served as if it had not."""

    # The head

    def _await_head(self) -> None:
        """Start the clock of a head, where no request is under way."""
        if self.conn.their_state is h11.IDLE:
            self._head_deadline.start(self._shared.bounds.head_seconds)

    def _head_is_late(self) -> None:
        if self.conn.trailing_data[0]:
            seconds = self._shared.bounds.head_seconds
            self._say(408, "head-timeout", f"no request within {seconds:g} seconds")
        else:
            self.transport.close()

    def _say(self, status: int, code: str, detail: str, more: bytes = b"") -> None:
        """Answer what never became a request, write that down, and end the connection."""
        fields = {"status": status, "code": code, "client": self._address}
        log.warning("no request: %s", detail, extra={"fields": fields})
        self.transport.write(refusal(status, code, detail, more))
        self.transport.close()

    # The answer

    async def _application(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Run the application; an answer before the body is whole says: the connection ends.

        So does each once the server drains: the next request would meet its end.
        """
        parser, drains = self.conn, self._shared.drains
        self._taking.begin()
        self._asked_at = self.loop.time()
        extensions = scope.setdefault("extensions", {})
        extensions[FLOODED] = lambda: parser.flooded
        extensions[LISTENS] = self._listen

        async def send_and_close(message: Message) -> None:
            starts = message["type"] == "http.response.start"
            if starts and (parser.their_state is h11.SEND_BODY or drains()):
                # A copy, and bytes: an application may reuse its list, and give any pairs.
                headers = [pair for pair in message["headers"] if pair[0].lower() != b"connection"]
                message = {**message, "headers": [*headers, CLOSE_HEADER]}
            for part in _parts(message):
                await send(part)

        # Starlette and uvicorn name the same things by types of their own.
        await self.config.loaded_app(scope, receive, send_and_close)  # pyright: ignore[reportArgumentType]

    def on_response_complete(self) -> None:
        """Rest, or go on with what has come meanwhile."""
        self._listens = False
        super().on_response_complete()
        if self.transport.is_closing():
            return
        self._say_to_crowd()
        if self.conn.their_state is h11.IDLE and self.conn.trailing_data[0]:
            self._await_head()

    def pause_writing(self) -> None:
        """Start the client's clock: it has more to take than it takes."""
        super().pause_writing()
        self._taking.fall_behind()
        self._say_to_crowd()

    def resume_writing(self) -> None:
        """Stop the client's clock: it has caught up."""
        self._taking.catch_up()
        self._say_to_crowd()
        if self.transport.is_closing():
            self._end_deadline.start(self._shared.bounds.answer.idle)
        super().resume_writing()

    # The end

    def _end(self) -> None:
        """Close; where the client may still be sending, half, until it has heard."""
        self._head_deadline.stop()
        self._unset_keepalive_if_required()
        self._listens = False
        self._say_to_crowd()
        real, bounds = self._outlet.real, self._shared.bounds
        if self._is_heard():
            real.close()
            if not self._taking.waits:
                self._end_deadline.start(bounds.answer.idle)
        elif not real.is_closing():
            self._lingering = True
            self._linger_left = bounds.body_bytes - self.conn.body_bytes
            self._end_deadline.start(bounds.linger_seconds)
            # The client may have reset the connection.
            with suppress(OSError):
                if real.can_write_eof():
                    real.write_eof()
            if not real.is_reading():
                real.resume_reading()

    def _is_heard(self) -> bool:
        """Return whether nothing more is expected of the client; without a slot, nothing is."""
        if not self._has_slot:
            return True
        if self.conn.their_state is h11.IDLE:
            return not self.conn.trailing_data[0]
        return self.conn.their_state in (h11.DONE, h11.MUST_CLOSE, h11.CLOSED)

    def eof_received(self) -> None:
        """Hear that the client sends no more; asyncio closes, once what is written is taken."""
        if not self._taking.waits:
            self._end_deadline.start(self._shared.bounds.answer.idle)

    def _abort(self) -> None:
        self._outlet.real.abort()
