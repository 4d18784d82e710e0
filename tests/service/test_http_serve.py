"""`pns serve` as its users run it: a process with an address, settings and signals."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from service.example import part_glb
from tests.service.packages import served_file

PNS = Path(sys.executable).with_name("pns")
ADDRESS = re.compile(r"running on http://([\d.]+):(\d+)")


class Server:
    """A running `pns serve`."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.log = ""
        assert process.stderr is not None
        while not (found := ADDRESS.search(self.log)):
            line = process.stderr.readline()
            assert line, self.log
            self.log += line
        self.host, self.port = found[1], int(found[2])

    def connect(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection(self.host, self.port, timeout=30)

    def status(self, path: str) -> int:
        with closing(self.connect()) as connection:
            connection.request("GET", path)
            return connection.getresponse().status

    def wait_until_ready(self) -> None:
        for _ in range(600):
            if self.status("/readyz") == 200:
                return
            time.sleep(0.05)
        pytest.fail("not ready")


@contextmanager
def serving(*arguments: str, **environment: str) -> Iterator[Server]:
    process = subprocess.Popen(
        [str(PNS), "serve", "--port", "0", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
        start_new_session=True,
    )
    with process:
        try:
            yield Server(process)
        finally:
            process.kill()


def begin_upload(
    server: Server, body: bytes, *, query: str = "", whole: bool = False
) -> http.client.HTTPConnection:
    connection = server.connect()
    connection.putrequest("POST", f"/subdivide?{query}")
    connection.putheader("Content-Type", "model/gltf-binary")
    connection.putheader("Content-Length", str(len(body)))
    connection.endheaders()
    connection.send(body if whole else body[: len(body) // 2])
    return connection


def refusal(connection: http.client.HTTPConnection) -> tuple[int, bytes]:
    with closing(connection):
        answer = connection.getresponse()
        return answer.status, answer.read()


def test_a_request_under_way_at_sigterm_completes_and_new_ones_are_refused() -> None:
    body = part_glb()
    with serving(PNS_WORKERS="1") as server:
        server.wait_until_ready()
        under_way = begin_upload(server, body, query="levels=4", whole=True)
        time.sleep(0.2)
        # To the whole group, as a supervisor may do it: the workers must not take it as theirs.
        os.killpg(server.process.pid, signal.SIGTERM)
        time.sleep(0.2)
        assert server.status("/readyz") == 503
        assert server.status("/healthz") == 200
        status, text = refusal(begin_upload(server, body))
        assert status == 503
        assert b'"draining"' in text

        answer = under_way.getresponse()
        assert answer.status == 200
        assert answer.read(4) == b"glTF"
        under_way.close()
        assert server.process.wait(20) == 0


def test_bodies_that_have_not_arrived_at_sigterm_are_refused() -> None:
    with serving(PNS_WORKERS="1") as server:
        hanging = begin_upload(server, bytes(1000))
        time.sleep(0.3)
        began = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        status, text = refusal(hanging)
        assert status == 503
        assert b'"draining"' in text
        assert server.process.wait(20) == 0
        assert time.monotonic() - began < 10


@pytest.mark.parametrize("drain_seconds", ["60", "0.1"])
def test_a_second_sigterm_and_the_deadline_end_running_jobs_in_order(drain_seconds: str) -> None:
    with serving(PNS_WORKERS="1", PNS_DRAIN_SECONDS=drain_seconds) as server:
        server.wait_until_ready()
        under_way = begin_upload(server, part_glb(), query="levels=5", whole=True)
        time.sleep(0.3)
        began = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        if drain_seconds == "60":
            time.sleep(0.3)
            server.process.send_signal(signal.SIGTERM)
        status, text = refusal(under_way)
        assert status == 503
        assert b'"draining"' in text
        assert server.process.wait(20) == 0
        assert time.monotonic() - began < 10
        assert server.process.stderr is not None
        assert "Traceback" not in server.process.stderr.read()


def test_an_idle_server_stops_at_once() -> None:
    with serving(PNS_WORKERS="1") as server:
        began = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(20) == 0
        assert time.monotonic() - began < 10


def test_options_win_over_the_environment() -> None:
    with serving("--host", "127.0.0.2", PNS_HOST="127.0.0.3", PNS_WORKERS="1") as server:
        assert server.host == "127.0.0.2"
        assert server.status("/healthz") == 200


def test_the_served_model_is_a_name_or_a_file(tmp_path: Path) -> None:
    for given in ("paper", served_file(tmp_path / "mine.onnx")):
        arguments = ("--model", given)
        with serving(*arguments, PNS_WORKERS="1", PNS_MODEL="missing.onnx") as server:
            server.wait_until_ready()
            with closing(server.connect()) as connection:
                connection.request("GET", "/models")
                listed = json.loads(connection.getresponse().read())
        default = [entry["name"] for entry in listed if entry["default"]]
        assert default == [Path(given).stem]
