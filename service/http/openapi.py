"""The description of the service for /docs, such that generators make working clients of it.

Generators want names: one schema for problems, by reference; an id for each
operation; a file as `application/octet-stream`; one kind of answer for one operation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Literal

from fastapi.routing import APIRoute
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


def _json(schema: str) -> dict[str, Any]:
    return {"content": {media.JSON: {"schema": _named(schema)}}}


def problem(reason: str) -> dict[str, Any]:
    """Return the description of an answer that is a problem."""
    return {
        "description": reason,
        "content": {problems.MEDIA_TYPE: {"schema": _named("Problem")}},
    }


def _problems(**reasons: str) -> dict[int | str, dict[str, Any]]:
    return {int(status[1:]): problem(reason) for status, reason in reasons.items()}


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
        **_problems(
            _400="The body cannot be read",
            _408="The body took too long to arrive",
            _413="Over a limit: body, predicted faces, levels or memory",
            _429="The client has too many requests under way, or its budget of faces is used up "
            "(see Retry-After)",
            _415="A content type that is not taken",
            _422="A bad parameter, a file that breaks its promises, or a mesh not to be refined",
            _500="A fault of the service",
            _503="Busy, the worker died (see Retry-After), or without a model",
            _504="The job took too long",
        ),
    },
}

REPORT: dict[str, Any] = SUBDIVIDE | {
    "summary": "The report of a refinement, without its file",
    "description": "Parameters and bodies are those of `POST /subdivide`.",
    "responses": SUBDIVIDE["responses"]
    | {200: {"description": "The report", "headers": _SERVER_TIMING, **_json("Report")}},
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
        **_problems(
            _500="A fault of the service",
            _503="Busy (see Retry-After)",
        ),
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

LIMITS: dict[str, Any] = {"summary": "What a request may ask for"}

HEALTHZ: dict[str, Any] = {"tags": ["probes"], "summary": "Whether the process answers"}

READYZ: dict[str, Any] = {
    "tags": ["probes"],
    "summary": "Whether a worker has the model",
    "responses": _problems(_503="Without a model"),
}

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
    schemas |= SCHEMAS
    for operations in document["paths"].values():
        for method, operation in operations.items():
            responses = operation["responses"]
            if OPEN_TAG not in operation.get("tags", ()):
                also = {} if method == "get" else ASKED_FOR_WORK
                for status, text in (EVERYWHERE | also).items():
                    responses.setdefault(status, problem(text))
                operation["security"] = [{}, {"key": []}]
            else:
                # Nobody needs a key.
                operation["security"] = []
            for status, answer in responses.items():
                own = answer.get("headers", {})
                answer["headers"] = own | HEADERS.get(status, {}) | _REQUEST_ID
    components["securitySchemes"] = {
        "key": {
            "type": "http",
            "scheme": "bearer",
            "description": "needed where the service has keys",
        }
    }
    return document
