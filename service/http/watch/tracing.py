"""Traces by OpenTelemetry, where the extra `tracing` is installed and an endpoint is named.

The standard variables say where they go (`OTEL_EXPORTER_OTLP_ENDPOINT` and its kin). Like the log,
spans hold neither paths nor queries: FastAPI's own would.
"""

# The extra is not installed where this is checked.
# pyright: reportMissingImports=false
from __future__ import annotations

import os
from typing import TYPE_CHECKING

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ...log_lines import HEADER
from .journal import METHODS

if TYPE_CHECKING:
    from opentelemetry.trace import Tracer

ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
NAME = "pns"
# What OpenTelemetry calls a method that it does not know.
OTHER = "_OTHER"


class TracingError(Exception):
    """Traces are wanted, and what sends them is not installed."""


def tracer_from_environment() -> Tracer | None:
    """Make a tracer that sends to the endpoint that the environment names; None if it names none.

    Raises:
        TracingError: the extra is not installed.
    """
    if not any(os.environ.get(name) for name in ENDPOINTS):
        return None
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import SERVICE_NAME, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError as error:
        raise TracingError(
            f"{ENDPOINTS[0]} is set and OpenTelemetry is not installed: "
            "pip install 'pns-subdivision[service,tracing]'"
        ) from error
    name = os.environ.get("OTEL_SERVICE_NAME", NAME)
    provider = TracerProvider(resource=Resource.create({SERVICE_NAME: name}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    return provider.get_tracer(NAME)


class Traced:
    """ASGI layer that makes a span of each request, under the caller's where it sends one."""

    def __init__(self, app: ASGIApp, tracer: Tracer) -> None:
        self.app = app
        self.tracer = tracer

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        from opentelemetry import propagate
        from opentelemetry.trace import SpanKind, StatusCode

        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        carrier = {
            name.decode("latin-1"): value.decode("latin-1")
            for name, value in scope["headers"]
            if name in (b"traceparent", b"tracestate")
        }
        # Anything may be sent as a method: of names without end others make series without end.
        method = scope["method"] if scope["method"] in METHODS else OTHER
        with self.tracer.start_as_current_span(
            method,
            context=propagate.extract(carrier),
            kind=SpanKind.SERVER,
            # Their texts are for the log.
            record_exception=False,
            set_status_on_exception=False,
        ) as span:
            status = 500

            async def seen(message: Message) -> None:
                nonlocal status
                if message["type"] == "http.response.start":
                    status = message["status"]
                    ids = [value for name, value in message["headers"] if name == HEADER]
                    span.set_attribute("pns.request_id", (ids or [b""])[0].decode("latin-1"))
                await send(message)

            try:
                await self.app(scope, receive, seen)
            finally:
                route = getattr(scope.get("route"), "path", None) or "none"
                span.update_name(f"{method} {route}")
                span.set_attribute("http.request.method", method)
                span.set_attribute("http.route", route)
                span.set_attribute("http.response.status_code", status)
                if status >= 500:
                    span.set_status(StatusCode.ERROR)
