"""Metrics for Prometheus, which prometheus_client serves on a port of their own."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable
from functools import partial
from importlib.metadata import version

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    Info,
    PlatformCollector,
    ProcessCollector,
    start_http_server,
)

from ...workers.models import Catalogue
from ..jobs import Job
from .journal import Entry

# From a small mesh to the longest job.
SECONDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 600)


class Metrics:
    """The service's metrics, in a registry of their own: two services in one process stay apart."""

    def __init__(self) -> None:
        own = self.registry = CollectorRegistry()
        counter, histogram = partial(Counter, registry=own), partial(Histogram, registry=own)
        self._requests = counter(
            "pns_requests", "Requests that have ended", ["route", "method", "status", "code"]
        )
        text = "Seconds from a request's head to the end of its answer"
        self._request_seconds = histogram("pns_request_seconds", text, ["route"], buckets=SECONDS)
        self._received = counter("pns_received_bytes", "Bytes of bodies", ["route"])
        self._sent = counter("pns_sent_bytes", "Bytes of answers", ["route"])
        text = "Seconds of a job by stage"
        self._stage_seconds = histogram("pns_stage_seconds", text, ["stage"], buckets=SECONDS)
        text = "Seconds that a job waited"
        self._queue_seconds = histogram("pns_queue_seconds", text, buckets=SECONDS)
        self._faces = counter("pns_faces", "Faces that came in and went out", ["direction"])
        self._restarts = counter("pns_worker_restarts", "Workers replaced", ["cause"])
        runs = {"version": version("pns-subdivision"), "python": platform.python_version()}
        Info("pns_build", "What runs", registry=own).info(runs)
        labels = ["name", "hash", "default"]
        self._model = Gauge("pns_model_info", "The models that are served", labels, registry=own)
        ProcessCollector(registry=own)
        PlatformCollector(registry=own)

    def request(self, entry: Entry) -> None:
        """Count a request; the journal calls this."""
        labels = (entry.route, entry.method, str(entry.status), entry.code)
        self._requests.labels(*labels).inc()
        self._request_seconds.labels(entry.route).observe(entry.seconds)
        self._received.labels(entry.route).inc(entry.received)
        self._sent.labels(entry.route).inc(entry.sent)

    def job(self, job: Job) -> None:
        """Count a job that has ended; `queue` among the stages is how long it waited."""
        for stage, value in job.seconds.items():
            if stage == "queue":
                self._queue_seconds.observe(value)
            elif stage != "total":
                self._stage_seconds.labels(stage).observe(value)
        if job.done is not None:
            self._faces.labels("in").inc(job.done.faces_in)
            self._faces.labels("out").inc(job.done.faces)

    def catalogue(self, catalogue: Catalogue) -> None:
        """Say which models are served."""
        for entry in json.loads(catalogue.content):
            self._model.labels(entry["name"], entry["hash"], str(entry["default"]).lower()).set(1)

    def gauge(self, name: str, text: str, value: Callable[[], float]) -> None:
        """Show a number that is asked for at each scrape."""
        Gauge(name, text, registry=self.registry).set_function(value)

    def restart(self, cause: str) -> None:
        """Count a worker that is replaced."""
        self._restarts.labels(cause).inc()

    def serve(self, host: str, port: int) -> int:
        """Serve them in a thread, by prometheus_client; return the port. Raises OSError."""
        server, _ = start_http_server(port, host, self.registry)
        return server.server_port
