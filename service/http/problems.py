"""Errors as RFC 9457 problem documents: one shape for every status, and never a stack trace."""

from __future__ import annotations

import logging
from collections.abc import Callable
from difflib import get_close_matches
from http import HTTPStatus
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from ..errors import BusyError, InvalidParameter, LimitError, ServiceError, UnauthorizedError
from ..log_lines import REQUEST_ID
from ..workers.worker import JobFaultError
from .parameters import Parameters

MEDIA_TYPE = "application/problem+json"

log = logging.getLogger("pns.service")


class Problem(BaseModel):
    """The problem document, as the API's description shows it."""

    type: str = Field(examples=["urn:pns:problem:invalid-parameter"])
    title: str
    status: int
    detail: str
    code: str = Field(description="stable slug to branch on")
    pointer: str | None = Field(default=None, description="JSON pointer of the offending value")
    parameter: str | None = Field(default=None, description="name of the offending parameter")
    choices: list[str] | None = Field(default=None, description="what the parameter may be")
    limit: str | None = Field(default=None, description="name of the limit that was exceeded")
    allowed: float | None = Field(default=None, description="the limit's value")
    found: float | None = Field(default=None, description="what this request would have taken")
    request_id: str | None = Field(
        default=None, description="the request's id, as in X-Request-ID and in the service's log"
    )


class ProblemResponse(JSONResponse):
    """A problem document, whose code goes into the journal; members that are None are left out."""

    media_type = MEDIA_TYPE

    def __init__(
        self,
        status: int,
        code: str,
        title: str,
        detail: str,
        *,
        headers: dict[str, str] | None = None,
        **members: Any,
    ) -> None:
        body = {
            "type": f"urn:pns:problem:{code}",
            "title": title,
            "status": status,
            "detail": detail,
            "code": code,
        }
        members["request_id"] = REQUEST_ID.get()
        body |= {name: value for name, value in members.items() if value is not None}
        super().__init__(body, status, headers=headers)
        self.code = code

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        scope.setdefault("state", {})["problem"] = self.code
        await super().__call__(scope, receive, send)


class Checked:
    """ASGI layer that answers with the problem where a check of a request's head finds one."""

    def __init__(self, app: ASGIApp, check: Callable[[Scope], None]) -> None:
        self.app = app
        self.check = check

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        try:
            self.check(scope)
        except ServiceError as error:
            await of_service_error(error)(scope, receive, send)
        else:
            await self.app(scope, receive, send)


def of_service_error(error: ServiceError) -> ProblemResponse:
    """Return the document of an error that the service foresees."""
    members: dict[str, Any] = {"pointer": error.pointer}
    headers: dict[str, str] = {}
    match error:
        case LimitError():
            members |= {"limit": error.limit, "allowed": error.allowed, "found": error.found}
        case InvalidParameter():
            members |= {"parameter": error.name, "choices": list(error.choices) or None}
        case BusyError():
            headers["Retry-After"] = str(error.retry_after)
        case UnauthorizedError():
            headers["WWW-Authenticate"] = 'Bearer realm="pns"'
    return ProblemResponse(
        error.status, error.code, error.title, error.detail, headers=headers, **members
    )


def of_failure(error: ServiceError | JobFaultError) -> ProblemResponse:
    """Return the document of a request or job that failed, and log what is no client's fault."""
    if isinstance(error, JobFaultError):
        log.error("a job failed in its worker:\n%s", error)
        return internal_error()
    if error.status >= 500:
        log.warning("%s: %s", error.code, error)
    return of_service_error(error)


def internal_error() -> ProblemResponse:
    """Return the document of a fault of ours: plain, because its details belong in the log."""
    text = "The service failed; it is logged."
    return ProblemResponse(500, "internal-error", "Internal error", text)


async def _failure(_: Request, error: ServiceError | JobFaultError) -> ProblemResponse:
    return of_failure(error)


async def _validation_error(_: Request, error: RequestValidationError) -> ProblemResponse:
    first = error.errors()[0]
    name = next((str(part) for part in first["loc"][1:]), "")
    text = first["msg"]
    if first["type"] == "extra_forbidden":
        near = get_close_matches(name, Parameters.model_fields, n=1)
        text = f"there is no such parameter{f'; is it {near[0]}?' if near else ''}"
    return of_service_error(InvalidParameter(name, f"{name}: {text}"))


async def _http_exception(_: Request, error: HTTPException) -> ProblemResponse:
    title = HTTPStatus(error.status_code).phrase
    code = title.lower().replace(" ", "-")
    headers, detail = dict(error.headers or {}), str(error.detail)
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        detail = f"this path takes {headers['Allow']}"
    elif detail == HTTPStatus.NOT_FOUND.phrase:
        detail = "there is nothing at this path; /docs shows what there is"
    return ProblemResponse(error.status_code, code, title, detail, headers=headers)


async def _client_disconnect(_: Request, error: ClientDisconnect) -> Response:
    # Nobody reads it; the number is the one that proxies log for this.
    return Response(status_code=499)


async def _fault(_: Request, error: Exception) -> ProblemResponse:
    # Starlette answers with this and raises the error again, so that the server logs it.
    return internal_error()


# Every error of an application, as a problem document.
HANDLERS: dict[Any, Any] = {
    ServiceError: _failure,
    JobFaultError: _failure,
    RequestValidationError: _validation_error,
    HTTPException: _http_exception,
    ClientDisconnect: _client_disconnect,
    Exception: _fault,
}
