"""Log lines: one JSON object each, whatever is in it, and never longer than `LONGEST`.

At a terminal they are text, with the same escapes.
"""

from __future__ import annotations

import json
import logging
import logging.config
import re
import secrets
import sys
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any

# Of a text, characters; a traceback is the longest that is worth keeping.
LONGEST = 8_000
CUT = "…"
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


class JsonLines(logging.Formatter):
    """A record as JSON in ASCII: control characters and line ends are escaped, so no text that a
    client sends can look like a line of its own or speak to a terminal.
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        fields: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": _bounded(record.getMessage()),
        }
        if (request_id := getattr(record, "request_id", None) or REQUEST_ID.get()) is not None:
            fields["request_id"] = request_id
        for name, value in getattr(record, "fields", {}).items():
            fields[name] = _bounded(value) if isinstance(value, str) else value
        if record.exc_info:
            fields["traceback"] = _bounded(self.formatException(record.exc_info))
        # JSON leaves one control character as it is.
        return json.dumps(fields, default=str).replace("\x7f", "\\u007f")


class TerminalLines(JsonLines):
    """A record as text for a terminal: time of day, message, and fields as JSON."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        fields = json.loads(super().format(record))
        del fields["logger"]
        time, level, message = (fields.pop(name) for name in ("time", "level", "message"))
        time = time.partition("T")[2].partition(".")[0] + "Z"
        told = "".join(f" {name}={json.dumps(value)}" for name, value in fields.items())
        return f"{time} {level}: {ascii(message)[1:-1]}{told}".replace("\x7f", "\\u007f")


def configure() -> None:
    """Send every logger's lines to stderr, uvicorn's too: as text to a terminal, else as JSON."""
    formatter = TerminalLines if sys.stderr.isatty() else JsonLines
    logging.config.dictConfig(
        {
            "version": 1,
            "disable_existing_loggers": False,
            "formatters": {"lines": {"()": formatter}},
            "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "lines"}},
            "root": {"handlers": ["stderr"], "level": logging.WARNING},
            "loggers": {
                "pns": {"level": logging.INFO},
                "uvicorn.error": {"level": logging.INFO},
            },
        }
    )


def _bounded(text: str) -> str:
    """Return the beginning and the end of a text too long: a traceback's cause stands last."""
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2
    return f"{text[:half]}{CUT}{text[-half:]}"
