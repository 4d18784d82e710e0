"""Describe bodies, answers and every error of each route for /docs."""

from __future__ import annotations

from typing import Any

from ..bodies import media
from . import problems
from .problems import Problem


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
    "content": {media.BYTES: _binary(), media.GLB: _binary()},
    "headers": _SERVER_TIMING,
}

SUBDIVIDE: dict[str, Any] = {
    "summary": "Refine every triangle mesh of a glTF",
    "description": (
        "Answers with the refined GLB, whose `asset.extras.pns` holds the report; with "
        "`Accept: application/json`, as `POST /report` does. "
        "Materials, textures, nodes and names stay. OBJ, PLY, STL and OFF come as their media "
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
            _429="The client's budget of faces is used up (see Retry-After)",
            _415="A content type that is not taken",
            _422="A bad parameter, a file that breaks its promises, or a mesh not to be refined",
            _500="A fault of the service",
            _503="Busy or two workers died (see Retry-After), shutting down, or without a model",
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
            _503="Busy (see Retry-After), or shutting down",
        ),
    },
}

JOB_FIELDS: dict[str, Any] = {
    "id": {"type": "string"},
    "state": {
        "type": "string",
        "enum": ["queued", "running", "done", "failed", "cancelled"],
    },
    "queue_place": {"type": ["integer", "null"], "description": "jobs in front of it"},
    "stage": {"type": ["string", "null"], "description": "read, weld, refine, …"},
    "share": {"type": "number", "description": "share of the work that is done, 0 … 1"},
    "estimate_seconds": {"type": ["number", "null"], "description": "until it ends"},
    "faces": {"type": ["integer", "null"], "description": "predicted refined faces"},
    "format": {"type": "string", "description": "of its result, as it was asked for"},
    "problem": {
        "anyOf": [_named("Problem"), {"type": "null"}],
        "description": "what it failed with; its `request_id` is that of the request that made it",
    },
}

_UNKNOWN = "No job has this id, or its result is no longer kept"

JOBS: dict[str, Any] = SUBDIVIDE | {
    "summary": "Hand in a file to refine, and come back for the result",
    "description": (
        "Parameters and bodies are those of `POST /subdivide`. `Location` is where the job is "
        "looked at. It goes on when the connection is gone."
    ),
    "responses": {
        202: {
            "description": "The job",
            "headers": {"Location": {"schema": {"type": "string"}}},
            **_json("Job"),
        },
        **{code: response for code, response in SUBDIVIDE["responses"].items() if code != 200},
    },
}

JOB: dict[str, Any] = {
    "summary": "How far a job is",
    "responses": {200: {"description": "The job", **_json("Job")}, **_problems(_404=_UNKNOWN)},
}

EVENTS: dict[str, Any] = {
    "summary": "How far a job is, as it goes on",
    "description": "Server-sent events named `progress`, one for each change, until the job ends.",
    "responses": {
        200: {
            "description": "The stream",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        **_problems(_404=_UNKNOWN),
    },
}

RESULT: dict[str, Any] = {
    "summary": "The result of a job",
    "description": (
        "The refined GLB; with `Accept: application/json`, its report. Of a job that failed, the "
        "problem that it failed with."
    ),
    "responses": {
        200: _FILE,
        **{code: SUBDIVIDE["responses"][code] for code in (400, 413, 415, 422, 500, 504)},
        **_problems(
            _404=_UNKNOWN,
            _409="The job has not ended, or was cancelled",
            _503="Clients that take their answers leave no room for this one, or the service shuts "
            "down (see Retry-After); or the job failed with it",
        ),
    },
}

JOB_REPORT: dict[str, Any] = {
    "summary": "The report of a job",
    "responses": RESULT["responses"] | {200: REPORT["responses"][200]},
}

# The schemas that the routes above name.
SCHEMAS: dict[str, dict[str, Any]] = {
    "Problem": Problem.model_json_schema(),
    "Job": {"type": "object", "required": list(JOB_FIELDS), "properties": JOB_FIELDS},
    "Report": {
        "type": "object",
        "description": "what was done, in numbers",
        "additionalProperties": True,
    },
}

DELETE_JOB: dict[str, Any] = {
    "summary": "Cancel a job, or forget one that has ended",
    "responses": {204: {"description": "Its worker is free"}, **_problems(_404=_UNKNOWN)},
}

LIMITS: dict[str, Any] = {"summary": "What a request may ask for"}

HEALTHZ: dict[str, Any] = {"tags": ["probes"], "summary": "Whether the process answers"}

READYZ: dict[str, Any] = {
    "tags": ["probes"],
    "summary": "Whether a worker has the model and new requests are taken",
    "responses": _problems(_503="Shutting down, or without a model"),
}
