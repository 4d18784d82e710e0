"""Log lines: one JSON object each, whatever is in it, and never longer than `LONGEST`."""

from __future__ import annotations

import json
import logging
import logging.config
from datetime import UTC, datetime
from typing import Any

from .request_ids import REQUEST_ID

# Of a text, characters; a traceback is the longest that is worth keeping.
LONGEST = 8_000
CUT = "…"


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


def configure() -> None:
    """Send every logger's lines to stderr as JSON; uvicorn's own among them."""
    logging.config.dictConfig(
        {
            "version": 1,
            "disable_existing_loggers": False,
            "formatters": {"json": {"()": JsonLines}},
            "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "json"}},
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
