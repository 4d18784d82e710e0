"""Traces by FastAPI's own OpenTelemetry, where the extra `tracing` is installed.

The standard variables say where they go (`OTEL_EXPORTER_OTLP_ENDPOINT` and its kin). Like the log,
spans hold neither paths nor queries, which FastAPI's would.
"""

# The extra is not installed where this is checked.
# pyright: reportMissingImports=false
from __future__ import annotations

import os
from typing import TYPE_CHECKING

from opentelemetry import trace

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider

ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
# Attributes whose values strangers choose.
HIDDEN = ("url.path", "url.query", "server.address", "http.request.method_original")


class TracingError(Exception):
    """Traces are wanted, and what sends them is not installed."""


def provider_from_environment() -> TracerProvider | None:
    """Make a provider that sends to the endpoint that the environment names; None if none is.

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
    name = os.environ.get("OTEL_SERVICE_NAME", "pns")
    provider = TracerProvider(resource=Resource.create({SERVICE_NAME: name}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    return provider


def mark_span(request_id: str) -> None:
    """Name the request in its span, if it has one, and hide there what strangers choose."""
    span = trace.get_current_span()
    if span.is_recording():
        span.set_attributes({"pns.request_id": request_id} | dict.fromkeys(HIDDEN, ""))
