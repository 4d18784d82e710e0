"""The description of the service for /docs, such that generators make working clients of it.

Generators want names: one schema for problems, by reference; an id for each
operation; a file as `application/octet-stream`; one kind of answer for one operation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Literal

from pydantic import BaseModel, Field

from ..bodies import media
from . import problems
from .problems import Problem


class Progress(BaseModel):
    """Progress of a job, as a part of a stream."""

    state: Literal["queued", "running"]
    place: int | None = Field(description="jobs in front of it; null once it runs")
    stage: str | None = Field(description="read, weld, refine, …")
    share: float = Field(description="share of the work that is done, 0 … 1")


def _binary(**more: str) -> dict[str, Any]:
    return {"schema": {"type": "string", "format": "binary"} | more}


_BODY = {
    "required": True,
    "content": {
        media.GLB: _binary(),
        media.GLTF: {
            "schema": {"type": "object", "description": "glTF 2.0 with embedded (data:) buffers"}
        },
        **{kind: _binary() for kind in media.FORMATS if kind not in (media.GLB, media.GLTF)},
        media.BYTES: _binary(
            description="a GLB, glTF JSON or an archive of one, told by its first bytes"
        ),
        media.ZIP: _binary(description="one .gltf or .glb, and the files that it names"),
        media.MULTIPART: {
            "schema": {
                "type": "object",
                "required": ["file"],
                "properties": {"file": _binary()["schema"]},
                "additionalProperties": _binary(
                    description="a file that the document names, under that name"
                )["schema"],
            }
        },
    },
}


def _named(schema: str) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{schema}"}


# What an answer of each status says, whichever route gives it.
_REASONS = {
    400: "The body cannot be read",
    401: "A key is needed, or the one sent is not known",
    403: "A page of another origin asks, and is not named",
    408: "The body took too long to arrive",
    413: "Over a limit: body, predicted faces, levels or memory",
    415: "A content type that is not taken",
    422: "A bad parameter, a file that breaks its promises, or a mesh not to be refined",
    429: "The client has too many requests under way, or its budget of faces is used up",
    500: "A fault of the service",
    503: "Busy, too many connections, the worker died, or without a model",
    504: "The job took too long",
}


def _problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    content = {problems.MEDIA_TYPE: {"schema": _named("Problem")}}
    return {each: {"description": _REASONS[each], "content": content} for each in statuses}


_SERVER_TIMING = {
    "Server-Timing": {"description": "milliseconds of each stage", "schema": {"type": "string"}}
}

_FILE = {
    "description": "The refined file",
    # Plain bytes first: generators take the first kind that they know.
    "content": {
        media.BYTES: _binary(),
        media.GLB: _binary(),
        media.MIXED: _binary(
            description="parts that each say what they are by `Content-Description`: `progress` "
            "(the schema Progress) at least every five seconds, then `file` and `report`, or "
            "`problem`; whole only with the closing boundary"
        ),
    },
    "headers": _SERVER_TIMING,
}

SUBDIVIDE: dict[str, Any] = {
    "summary": "Refine every triangle mesh of a glTF",
    "description": (
        "Answers with the refined GLB, whose `asset.extras.pns` holds the report; with "
        "`Accept: application/json`, as `POST /report` does; with `Accept: multipart/mixed`, with "
        "a stream of how far it is, and then both. "
        "Materials, textures, nodes and names stay. OBJ, PLY, STL, OFF and 3MF come as their media "
        "type, or in a form under a file name with their extension; what they hold that a GLB of "
        "plain triangles does not is named in the report's `changes`."
    ),
    "openapi_extra": {"requestBody": _BODY},
    "responses": {
        200: _FILE,
        **_problems(400, 408, 413, 415, 422, 500, 504),
    },
}

REPORT: dict[str, Any] = SUBDIVIDE | {
    "summary": "The report of a refinement, without its file",
    "description": "Parameters and bodies are those of `POST /subdivide`.",
    "responses": SUBDIVIDE["responses"]
    | {
        200: {
            "description": "The report",
            "headers": _SERVER_TIMING,
            "content": {media.JSON: {"schema": _named("Report")}},
        }
    },
}

MODELS: dict[str, Any] = {
    "summary": "The models that `model=` may name",
    "description": (
        "The bundled models and the one that is served, each with its card, sorted by name. "
        "The bytes change only with the service: `If-None-Match` with the `ETag` saves them."
    ),
    "responses": {
        200: {"headers": {"ETag": {"schema": {"type": "string"}}}},
        304: {"description": "The client has this list"},
        **_problems(500),
    },
}

# The schemas that the routes above name.
SCHEMAS: dict[str, dict[str, Any]] = {
    "Problem": Problem.model_json_schema(),
    "Progress": Progress.model_json_schema(),
    "Report": {
        "type": "object",
        "description": "what was done, in numbers",
        "additionalProperties": True,
    },
}

PROBES = "probes"
READYZ: dict[str, Any] = {
    "tags": [PROBES],
    "summary": "Whether a worker has the model",
    "responses": _problems(503),
}

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
_KEY = {
    "type": "http",
    "scheme": "bearer",
    "description": "needed where the service has keys",
}
# Beside those of a route's own.
HEADERS = {"401": _CHALLENGE, "429": _RETRY_AFTER, "503": _RETRY_AFTER}


def described(make: Callable[[], dict[str, Any]]) -> Callable[[], dict[str, Any]]:
    """Return what makes the document, once: FastAPI calls it for /openapi.json."""

    @cache
    def document() -> dict[str, Any]:
        made = make()
        components = made.setdefault("components", {})
        components["securitySchemes"] = {"key": _KEY}
        components.setdefault("schemas", {}).update(SCHEMAS)
        for operations in made["paths"].values():
            for method, operation in operations.items():
                _complete(operation, asks_for_work=method == "post")
        return made

    return document


def _complete(operation: dict[str, Any], *, asks_for_work: bool) -> None:
    """Say of an operation what every route may answer, and whether a key is needed."""
    responses, is_probe = operation["responses"], PROBES in operation.get("tags", ())
    operation["security"] = [] if is_probe else [{}, {"key": []}]
    if not is_probe:
        also = _problems(401, 429, 503, *([403] if asks_for_work else []))
        operation["responses"] = responses = {str(each): also[each] for each in also} | responses
    for status, answer in responses.items():
        own = answer.get("headers", {})
        answer["headers"] = own | HEADERS.get(status, {}) | _REQUEST_ID
