"""The stream: how far a job is, then the file and the report, or why there is none."""

import json
import socket
from concurrent.futures import ThreadPoolExecutor
from email import message_from_bytes

import pytest

from service.http import answer as answers
from tests.support.live import received, request_head, served, until

MIXED = "multipart/mixed"
STREAM = {"Accept": MIXED}


@pytest.fixture(scope="module")
def address():
    with served(workers=2, queue=2, client_requests=3, job_seconds=3600) as where:
        yield where


def parts_of(answer):
    """The parts, as Python's own reader of MIME finds them."""
    assert answer.status_code == 200
    head = f"Content-Type: {answer.headers['content-type']}\r\n\r\n".encode()
    message = message_from_bytes(head + answer.content)
    assert message.is_multipart()
    assert message.defects == []
    return message.get_payload()


def views_of(answer):
    """The progress of the job, as it is told."""
    return (json.loads(line) for line in answer.iter_lines() if line.startswith("{"))


def begin(address, body, accept=MIXED):
    connection = socket.create_connection(address, timeout=600)
    head = request_head(f"Accept: {accept}", f"Content-Length: {len(body)}")
    connection.sendall(head + body)
    return connection


def streamed(client, body):
    return client.stream("POST", "/subdivide", content=body, headers=STREAM)


def in_steps(folder):
    """A job that goes on as files of a folder let it."""
    return f"steps {folder}".encode()


def let_go(folder):
    for number in (1, 2, 3):
        (folder / f"go-{number}").touch()


def test_the_file_and_the_report_come_last(client):
    parts = parts_of(client.post("/subdivide", content=b"echo", headers=STREAM))
    *progress, file, report = parts
    assert {part["Content-Description"] for part in progress} == {"progress"}
    assert [part["Content-Description"] for part in (file, report)] == ["file", "report"]
    assert file.get_payload(decode=True) == report.get_payload(decode=True) == b"echo"
    assert file["Content-Length"] == "4"
    assert "refine;dur=2.0" in file["Server-Timing"]


def test_a_job_that_fails_ends_with_its_problem(client):
    headers = STREAM | {"X-Request-ID": "mine"}
    for body, status, code in (
        (b"broken", 422, "invalid-gltf"),
        (b"fault", 500, "internal-error"),
        (b"die", 503, "worker-died"),
    ):
        *_, last = parts_of(client.post("/subdivide", content=body, headers=headers))
        assert last.get_content_type() == "application/problem+json"
        problem = json.loads(last.get_payload(decode=True))
        said = {"status": status, "code": code, "request_id": "mine"}
        assert said.items() <= problem.items()
        assert "secret" not in str(problem)


def test_what_is_refused_before_its_job_is_no_stream(client):
    answer = client.post("/subdivide?levels=9", content=b"echo", headers=STREAM)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"


def test_its_share_and_stage_are_told_as_it_goes_on(client, tmp_path):
    seen = []
    with streamed(client, in_steps(tmp_path)) as answer:
        for view in views_of(answer):
            seen.append(view)
            (tmp_path / f"go-{round(4 * view['share'])}").touch()
    assert [view["share"] for view in seen if view["share"]] == [0.25, 0.5, 0.75]
    assert seen[-1] == {"state": "running", "place": None, "stage": "refine", "share": 0.75}


def test_a_stream_is_never_silent_for_long(client, tmp_path, monkeypatch):
    """A proxy ends a connection on which nothing moves."""
    monkeypatch.setattr(answers, "LOOK_SECONDS", 0.02)
    monkeypatch.setattr(answers, "SILENT_SECONDS", 0.1)
    same = 0
    with streamed(client, in_steps(tmp_path)) as answer:
        for view in views_of(answer):
            same += view["share"] == 0.25
            if same == 3:
                let_go(tmp_path)
    assert same >= 3


def test_one_that_waits_is_told_its_place(address, client, tmp_path):
    """One client runs one job where there are two workers."""
    with begin(address, in_steps(tmp_path)):
        until((tmp_path / "took-1").exists)
        with streamed(client, b"next") as answer:
            queued = {"state": "queued", "place": 0, "stage": None, "share": 0.0}
            assert next(views_of(answer)) == queued
            let_go(tmp_path)


def test_429_for_more_than_a_client_may_have(address, client, tmp_path):
    held = [begin(address, in_steps(tmp_path)) for _ in range(3)]
    until((tmp_path / "took-1").exists)
    until(lambda: client.post("/subdivide", content=b"x").status_code == 429)
    refused = client.post("/subdivide", content=b"x")
    assert refused.json()["code"] == "too-many-requests"
    assert int(refused.headers["retry-after"]) >= 1
    for connection in held:
        connection.close()
    until(lambda: client.post("/subdivide", content=b"x").status_code == 200)


@pytest.mark.parametrize("accept", [MIXED, "*/*"])
@pytest.mark.parametrize("word", ["steps", "hold"])
def test_who_leaves_frees_its_worker_and_memory(address, client, tmp_path, word, accept):
    """Also where its job does not look; a job may take an hour here."""
    for number in range(3):
        folder = tmp_path / str(number)
        folder.mkdir()
        with begin(address, f"{word} {folder}".encode(), accept):
            if word == "steps":
                until((folder / "took-1").exists)
    until(lambda: client.post("/subdivide", content=b"here").content == b"here")


def test_a_service_that_ends_leaves_a_stream_without_its_last_boundary(tmp_path, caplog):
    """That is how a client knows that nothing more comes."""
    with ThreadPoolExecutor(1) as reader, served(workers=1, drain_seconds=1) as where:
        connection = begin(where, in_steps(tmp_path))
        until((tmp_path / "took-1").exists)
        reading = reader.submit(received, connection)
    said = reading.result()
    connection.close()
    boundary = b"--" + said.partition(b"boundary=")[2].split(b"\r\n")[0]
    assert boundary in said
    assert boundary + b"--" not in said
    assert not said.endswith(b"0\r\n\r\n")
    assert not any(record.exc_info for record in caplog.records)
