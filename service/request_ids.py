"""The name of a request: in its answer, in its problem, and in every line about it."""

from __future__ import annotations

import re
import secrets
from contextvars import ContextVar

HEADER = b"x-request-id"
# What may stand in a log, a header and a file name without a thought.
_SANE = re.compile(rb"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")

# The id of the request that is being served; a task that is started for it keeps it.
REQUEST_ID: ContextVar[str | None] = ContextVar("request_id", default=None)


def id_of(headers: list[tuple[bytes, bytes]]) -> str:
    """Return the id that the client sent, where it is a sane one, else a new one."""
    sent = [value for name, value in headers if name == HEADER]
    if len(sent) == 1 and _SANE.fullmatch(sent[0]):
        return sent[0].decode()
    return secrets.token_hex(8)
