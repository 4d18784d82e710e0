"""What /docs shows beside the parameters: bodies, answers and every error of each route."""

from __future__ import annotations

from typing import Any

from service import media, problems
from service.problems import Problem

_BINARY = {"schema": {"type": "string", "format": "binary"}}

_BODY = {
    "required": True,
    "content": {
        media.GLB: _BINARY,
        media.GLTF: {
            "schema": {"type": "object", "description": "glTF 2.0 with embedded (data:) buffers"}
        },
        media.ZIP: {
            "schema": {
                "type": "string",
                "format": "binary",
                "description": "one .gltf or .glb, and the files that it names",
            }
        },
        media.MULTIPART: {
            "schema": {
                "type": "object",
                "required": ["file"],
                "properties": {"file": {"type": "string", "format": "binary"}},
                "additionalProperties": {
                    "type": "string",
                    "format": "binary",
                    "description": "a file that the document names, under that name",
                },
            }
        },
    },
}


def _problems(**reasons: str) -> dict[int | str, dict[str, Any]]:
    return {
        int(status.removeprefix("_")): {
            "description": reason,
            "content": {problems.MEDIA_TYPE: {"schema": Problem.model_json_schema()}},
        }
        for status, reason in reasons.items()
    }


SUBDIVIDE: dict[str, Any] = {
    "summary": "Refine every triangle mesh of a glTF",
    "description": (
        "Answers with the refined GLB, whose `asset.extras.pns` holds the report; with "
        "`Accept: application/json`, with the report alone. "
        "Materials, textures, nodes and names stay."
    ),
    "openapi_extra": {"requestBody": _BODY},
    "responses": {
        200: {
            "description": "The refined file, or its report",
            "content": {media.GLB: _BINARY, "application/json": {"schema": {"type": "object"}}},
            "headers": {
                "Server-Timing": {
                    "description": "milliseconds of each stage",
                    "schema": {"type": "string"},
                }
            },
        },
        **_problems(
            _400="The body cannot be read",
            _408="The body took too long to arrive",
            _413="Over a limit: body, predicted faces, levels or memory",
            _415="A content type that is not taken",
            _422="A bad parameter, a file that breaks its promises, or a mesh not to be refined",
            _500="A fault of the service, or a worker that died",
            _503="Busy (see Retry-After), shutting down, or without a model",
            _504="The job took too long",
        ),
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
        **_problems(
            _500="A fault of the service, or a worker that died",
            _503="Busy (see Retry-After), or shutting down",
        ),
    },
}

HEALTHZ: dict[str, Any] = {"summary": "Whether the process answers"}

READYZ: dict[str, Any] = {
    "summary": "Whether a worker has the model and new requests are taken",
    "responses": _problems(_503="Shutting down, or without a model"),
}
