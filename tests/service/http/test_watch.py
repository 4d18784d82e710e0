"""Operators see request ids, log lines and metrics."""

import json
import logging
import re
import urllib.request
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from service.http.watch.metrics import Metrics
from service.log_lines import LONGEST, JsonLines, TerminalLines
from service.workers.models import Catalogue
from tests.support.live import GLB, obeying


@pytest.fixture(scope="module")
def client():
    with obeying() as opened:

        @opened.app.get("/breaks")
        async def breaks():
            raise ZeroDivisionError("secret")

        yield opened


def lines(caplog):
    """The journal's lines, as they would be written."""
    records = [record for record in caplog.records if record.name == "pns.request"]
    return [json.loads(JsonLines().format(record)) for record in records]


# Request ids


SANE = ["a", "7f3e-22.B_1", "x" * 64]
OTHERS = [[], ["a", "b"], *([each] for each in ("", "x" * 65, "-a", "a b", "a\x1b[31m", "{}", "é"))]


@pytest.mark.parametrize("sent", [*([each] for each in SANE), *OTHERS])
def test_a_sane_request_id_is_kept_and_any_other_replaced(client, sent, caplog):
    headers = [(b"x-request-id", each.encode("latin-1")) for each in sent]
    with caplog.at_level(logging.INFO):
        answer = client.get("/nothing", headers=headers)
    given_back = answer.headers["x-request-id"]
    assert (given_back in sent) is (sent not in OTHERS)
    assert sent not in OTHERS or len(given_back) == 16
    assert answer.json()["request_id"] == lines(caplog)[0]["request_id"] == given_back


def test_a_fault_of_the_server_is_a_problem_with_its_request_id_everywhere(client, caplog):
    with caplog.at_level(logging.INFO):
        answer = client.get("/breaks", headers={"X-Request-ID": "fault-1"})
    assert (answer.status_code, answer.json()["code"]) == (500, "internal-error")
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["x-request-id"] == answer.json()["request_id"] == "fault-1"
    assert "secret" not in answer.text
    (line,) = lines(caplog)
    assert (line["status"], line["route"]) == (500, "/breaks")


# Log lines


def test_one_line_for_each_request_with_what_it_was(client, caplog):
    with caplog.at_level(logging.INFO):
        client.post("/subdivide?levels=2&model=", content=b"echo this", headers=GLB)
        client.post("/subdivide", content=b"broken", headers=GLB)
        client.head("/healthz")
        client.request("BREW", "/secret-name.glb?secret=1")
    names = ("method", "route", "status", "code")
    told = [tuple(line[name] for name in names) for line in lines(caplog)]
    assert told == [
        ("POST", "/subdivide", 200, ""),
        ("POST", "/subdivide", 422, "invalid-gltf"),
        ("HEAD", "/healthz", 200, ""),
        ("other", "none", 404, "not-found"),
    ]
    assert (lines(caplog)[0]["received"], lines(caplog)[0]["sent"]) == (9, 9)
    assert "secret" not in json.dumps(lines(caplog))
    assert "levels" not in json.dumps(lines(caplog))


def record(message, **fields):
    made = logging.LogRecord("pns", logging.INFO, "", 0, message, None, None)
    made.fields = fields
    return made


@given(st.text(), st.text())
def test_no_text_ends_its_line_or_speaks_to_a_terminal(message, value):
    line = JsonLines().format(record(message.replace("%", ""), value=value))
    assert all(" " <= character <= "~" for character in line)
    assert json.loads(line)["value"] == value[: len(value)]
    line = TerminalLines().format(record(message.replace("%", ""), value=value))
    assert all(" " <= character <= "~" for character in line)
    assert re.match(r"\d\d:\d\d:\d\dZ info: .* value=", line)


def test_a_long_text_is_cut_in_its_middle_and_a_traceback_is_one_line():
    line = json.loads(JsonLines().format(record("a" * 10**6 + "z", value="b" * 10**6)))
    assert len(line["message"]) == len(line["value"]) == LONGEST + 1
    assert (line["message"][:3], line["message"][-2:]) == ("aaa", "az")
    made = record("failed")
    try:
        int("line\nend")
    except ValueError as error:
        made.exc_info = (type(error), error, error.__traceback__)
    line = JsonLines().format(made)
    assert "\n" not in line
    assert "ValueError: invalid literal" in json.loads(line)["traceback"]


def test_what_a_worker_says_has_the_id_of_its_request(capfd):
    headers = GLB | {"X-Request-ID": "of-a-worker"}
    with obeying() as client:
        assert client.post("/subdivide", content=b"log", headers=headers).status_code == 200
    # The worker wrote before it answered.
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "a job says" in line]
    said = json.loads(line)
    assert (said["request_id"], said["level"]) == ("of-a-worker", "warning")
    assert said["message"] == "a job says\nsomething"


# Metrics


def values_of(text):
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def labelled(values, name, /, **labels):
    return values.get((name, tuple(sorted(labels.items()))))


def scraped(client):
    return values_of(generate_latest(client.app.state.metrics.registry).decode())


def test_requests_are_counted_by_route_status_and_code(client):
    client.post("/subdivide", content=b"echo", headers=GLB)
    client.post("/subdivide", content=b"unreadable", headers=GLB)
    client.post("/subdivide", content=b"broken", headers=GLB | {"Accept": "multipart/mixed"})
    # What a layer refuses before its route, too.
    client.post("/subdivide", content=b"x", headers=GLB | {"Host": "another"})
    client.get("/assets/of-somebody", headers={"Host": "another"})
    client.post("/report", content=b"x", headers=GLB | {"Content-Length": str(2**40)})
    for n in range(20):
        client.request(f"M{n}", f"/made-up-{n}")
    values = scraped(client)
    # A stranger cannot make series.
    labels = [dict(each) for _, each in values]
    assert not any("made-up" in each.get("route", "") for each in labels)
    assert not any(each.get("method", "").startswith("M") for each in labels)
    for route, method, status, code in (
        ("/subdivide", "POST", "200", ""),
        ("/subdivide", "POST", "400", "unreadable"),
        # A stream has begun with its 200.
        ("/subdivide", "POST", "200", "invalid-gltf"),
        ("/subdivide", "POST", "400", "unknown-host"),
        ("/assets/{name}", "GET", "400", "unknown-host"),
        ("/report", "POST", "413", "limit-exceeded"),
    ):
        counted = {"route": route, "method": method, "status": status, "code": code}
        assert labelled(values, "pns_requests_total", **counted) >= 1, counted
    assert labelled(values, "pns_request_seconds_count", route="/subdivide") >= 2
    assert labelled(values, "pns_received_bytes_total", route="/subdivide") >= 14
    assert labelled(values, "process_open_fds") > 0


def test_jobs_faces_models_and_restarts_are_served_on_a_port_of_their_own():
    metrics = Metrics()
    done = SimpleNamespace(faces_in=4, faces=64)
    seconds = {"queue": 0.2, "read": 0.1, "refine": 0.3}
    metrics.job(SimpleNamespace(seconds=seconds, done=done))
    entry = {"name": "general", "hash": "ab" * 32, "default": True}
    metrics.catalogue(Catalogue(("general",), json.dumps([entry]).encode()))
    metrics.gauge("pns_queue_jobs", "Jobs that wait", lambda: 3)
    metrics.restart("worker-died")
    port = metrics.serve("127.0.0.1", 0)
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
        values = values_of(answer.read().decode())
    assert labelled(values, "pns_faces_total", direction="in") == 4
    assert labelled(values, "pns_faces_total", direction="out") == 64
    assert labelled(values, "pns_queue_seconds_sum") == pytest.approx(0.2)
    assert labelled(values, "pns_stage_seconds_sum", stage="refine") == pytest.approx(0.3)
    assert labelled(values, "pns_stage_seconds_count", stage="queue") is None
    assert labelled(values, "pns_model_info", name="general", hash="ab" * 32, default="true") == 1
    assert labelled(values, "pns_queue_jobs") == 3
    assert labelled(values, "pns_worker_restarts_total", cause="worker-died") == 1
    assert any(name == "pns_build_info" for name, _ in values)


# HEAD


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/models", "/openapi.json", "/docs", "/"])
def test_head_is_get_without_a_body(client, path):
    client.post("/subdivide", content=b"x", headers=GLB)
    head, get = client.head(path), client.get(path)
    assert (head.status_code, get.status_code) == (200, 200)
    assert head.content == b""
    assert head.headers | {"x-request-id": ""} == get.headers | {"x-request-id": ""}
