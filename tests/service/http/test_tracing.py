"""Traces: a span for each request, and nothing in it that a client would not like to see."""

import sys

import pytest

from service.http import app as application
from service.http.watch.tracing import HIDDEN, TracingError, provider_from_environment
from service.settings import Settings
from tests.support.live import obeying


@pytest.fixture
def traced(monkeypatch):
    """A client of a traced service, and its spans."""
    trace = pytest.importorskip("opentelemetry.sdk.trace")
    from opentelemetry.sdk.trace.export import SimpleSpanProcessor
    from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

    exporter, provider = InMemorySpanExporter(), trace.TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    monkeypatch.setattr(application, "provider_from_environment", lambda: provider)
    with obeying() as client:
        yield client, exporter.get_finished_spans


def test_a_request_is_a_span_under_its_callers(traced):
    client, spans = traced
    parent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
    answer = client.get("/healthz?secret=1", headers={"traceparent": parent})
    (span,) = spans()
    assert span.name == "GET /healthz"
    assert f"{span.context.trace_id:032x}" == parent.split("-")[1]
    assert f"{span.parent.span_id:016x}" == parent.split("-")[2]
    assert span.attributes["http.route"] == "/healthz"
    assert span.attributes["http.response.status_code"] == 200
    assert span.attributes["pns.request_id"] == answer.headers["x-request-id"]
    assert not any(span.attributes[name] for name in HIDDEN)
    assert "secret" not in span.to_json()


def test_a_fault_is_an_error_a_refusal_is_none_and_a_stranger_names_no_span(traced):
    client, spans = traced

    @client.app.get("/breaks")
    async def breaks():
        raise ZeroDivisionError("secret")

    client.get("/breaks")
    client.get("/nothing/secret")
    client.request("SECRET" * 9, "/healthz")
    fault, refusal, stranger = spans()
    assert stranger.attributes["http.request.method"] == "_OTHER"
    assert (fault.status.is_ok, fault.attributes["http.response.status_code"]) == (False, 500)
    assert (refusal.status.is_unset, refusal.name) == (True, "GET")
    assert "secret" not in str([span.to_json() for span in spans()]).lower()


def test_without_an_endpoint_nothing_is_traced_and_one_without_the_extra_is_refused(monkeypatch):
    monkeypatch.delenv("OTEL_EXPORTER_OTLP_ENDPOINT", raising=False)
    assert provider_from_environment() is None
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", "http://127.0.0.1:4318")
    monkeypatch.setitem(sys.modules, "opentelemetry.sdk.trace", None)
    with pytest.raises(TracingError, match="pip install"):
        application.create_app(Settings(workers=1))
