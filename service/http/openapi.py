"""The description of the service, such that generators make working clients of it.

Generators want names: one schema for problems and one for jobs, by reference; an id for each
operation; a file as `application/octet-stream`; one kind of answer for one operation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from fastapi.routing import APIRoute

from . import documentation

# What every route may answer, whatever it is asked; the rest is with the routes.
EVERYWHERE = {
    "401": "A key is needed, or the one sent is not known",
    "429": "Too much was asked for (see Retry-After)",
    "503": "Too many connections (see Retry-After)",
}
# And where it is asked for work.
ASKED_FOR_WORK = {"403": "A page of another origin asks, and is not named"}
OPEN_TAG = "probes"

_REQUEST_ID = {
    "X-Request-ID": {
        "description": "the id that the client sent, or a new one",
        "schema": {"type": "string"},
    }
}
_RETRY_AFTER = {
    "Retry-After": {
        "description": "seconds after which to ask again; none where that does not help",
        "schema": {"type": "integer", "minimum": 1},
    }
}
_CHALLENGE = {"WWW-Authenticate": {"schema": {"type": "string"}}}
# Beside those of a route's own.
HEADERS = {"401": _CHALLENGE, "429": _RETRY_AFTER, "503": _RETRY_AFTER}


def operation_id(route: APIRoute) -> str:
    """Return the name of the function: it is the clients' name of it, too."""
    return route.name


def described(make: Callable[[], dict[str, Any]]) -> Callable[[], dict[str, Any]]:
    """Return what makes the document, once: FastAPI calls it for /openapi.json."""
    return cache(lambda: _described(make()))


def _described(document: dict[str, Any]) -> dict[str, Any]:
    components = document.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    schemas |= documentation.SCHEMAS
    for operations in document["paths"].values():
        for method, operation in operations.items():
            responses = operation["responses"]
            # FastAPI's own errors are never sent: ours are with the routes.
            if responses.get("422", {}).get("content", {}).get("application/json"):
                del responses["422"]
            if OPEN_TAG not in operation.get("tags", ()):
                also = {} if method == "get" else ASKED_FOR_WORK
                for status, text in (EVERYWHERE | also).items():
                    responses.setdefault(status, documentation.problem(text))
                operation["security"] = [{}, {"key": []}]
            else:
                # Nobody needs a key.
                operation["security"] = []
            for status, answer in responses.items():
                own = answer.get("headers", {})
                answer["headers"] = own | HEADERS.get(status, {}) | _REQUEST_ID
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    components["securitySchemes"] = {
        "key": {
            "type": "http",
            "scheme": "bearer",
            "description": "needed where the service has keys",
        }
    }
    return document
