"""Traces by OpenTelemetry, where the extra `tracing` is installed and an endpoint is named.

The standard variables say where they go (`OTEL_EXPORTER_OTLP_ENDPOINT` and its kin). Like the log,
spans hold neither paths nor queries: FastAPI's own would.
"""

# The extra is not installed where this is checked.
# pyright: reportMissingImports=false
from __future__ import annotations

import os
from typing import TYPE_CHECKING

from .journal import METHODS, Entry

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


def record(tracer: Tracer, entry: Entry) -> None:
    """Make the span of a request that has ended, under the caller's where it sent one."""
    from opentelemetry import propagate
    from opentelemetry.trace import SpanKind, StatusCode

    # Anything may be sent as a method: of names without end others make series without end.
    method = entry.method if entry.method in METHODS else OTHER
    span = tracer.start_span(
        f"{method} {entry.route}",
        context=propagate.extract(entry.caller),
        kind=SpanKind.SERVER,
        start_time=int(1e9 * entry.began),
        attributes={
            "http.request.method": method,
            "http.route": entry.route,
            "http.response.status_code": entry.status,
            "pns.request_id": entry.id,
        },
    )
    if entry.status >= 500:
        span.set_status(StatusCode.ERROR)
    span.end()
