"""`pns serve` as its users run it: a process with an address, settings and signals."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import IO

import httpx2
import pytest

from service.meshfiles.example import part_glb
from tests.support.packages import served_file

PNS = Path(sys.executable).with_name("pns")
ADDRESS = re.compile(r"running on http://([\d.]+):(\d+)")
METRICS = re.compile(r"metrics on (http://\S+/metrics)")
GO_ON = b"HTTP/1.1 100 Continue\r\n\r\n"
# Only a server that does not end takes as long.
HANGS = 300


class Server:
    """A running `pns serve`."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.log = ""
        assert process.stderr is not None
        while not (told := ADDRESS.search(self.log)):
            line = process.stderr.readline()
            assert line, self.log
            self.log += line
        self.host, self.port = told[1], int(told[2])
        # A pipe that nobody reads is full after some hundred requests, and the server waits.
        self._rest = threading.Thread(target=self._read, args=(process.stderr,))
        self._rest.start()

    def _read(self, log: IO[str]) -> None:
        for line in log:
            self.log += line

    def whole_log(self) -> str:
        """All that it said; it has ended."""
        self._rest.join()
        return self.log

    def connect(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection(self.host, self.port, timeout=30)

    def status(self, path: str) -> int:
        with closing(self.connect()) as connection:
            connection.request("GET", path)
            return connection.getresponse().status

    def wait_until_ready(self) -> None:
        while self.status("/readyz") != 200:
            time.sleep(0.05)

    def wait_until_a_job_runs(self) -> None:
        told = METRICS.search(self.log)
        assert told is not None
        while "pns_jobs_running 1.0" not in httpx2.get(told[1]).text:
            time.sleep(0.01)


@contextmanager
def serving(*arguments: str, **environment: str) -> Iterator[Server]:
    process = subprocess.Popen(
        [str(PNS), "serve", "--port", "0", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PNS_METRICS_PORT": "0"} | environment,
        start_new_session=True,
    )
    with process:
        try:
            server = Server(process)
            yield server
        finally:
            process.kill()
        server.whole_log()


def begin_upload(
    server: Server, body: bytes, *, query: str = "", whole: bool = False
) -> http.client.HTTPConnection:
    connection = server.connect()
    connection.putrequest("POST", f"/subdivide?{query}")
    connection.putheader("Content-Type", "model/gltf-binary")
    connection.putheader("Content-Length", str(len(body)))
    connection.putheader("Expect", "100-continue")
    connection.endheaders()
    # What is refused at once is not told to go on.
    go_on = connection.sock.recv(len(GO_ON), socket.MSG_PEEK | socket.MSG_WAITALL) == GO_ON
    if go_on:
        assert connection.sock.recv(len(GO_ON)) == GO_ON
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
        under_way = begin_upload(server, body, query="levels=5", whole=True)
        server.wait_until_a_job_runs()
        # To the whole group, as a supervisor may do it: the workers must not take it as theirs.
        os.killpg(server.process.pid, signal.SIGTERM)
        while server.status("/readyz") != 503:
            pass
        assert server.status("/healthz") == 200
        status, text = refusal(begin_upload(server, body))
        assert status == 503
        assert b'"draining"' in text

        answer = under_way.getresponse()
        assert answer.status == 200
        assert answer.read(4) == b"glTF"
        under_way.close()
        assert server.process.wait(HANGS) == 0


def test_a_job_at_sigterm_completes_and_waits_to_be_fetched() -> None:
    with serving(PNS_WORKERS="1") as server:
        server.wait_until_ready()
        with closing(server.connect()) as connection:
            glb = {"Content-Type": "model/gltf-binary"}
            connection.request("POST", "/jobs?levels=5", part_glb(), glb)
            path = f"/jobs/{json.loads(connection.getresponse().read())['id']}"
        server.process.send_signal(signal.SIGTERM)
        while server.status("/readyz") != 503:
            pass
        while server.status(f"{path}/result") == 409:
            time.sleep(0.01)
        # The first status was that of the result: it has been fetched, and nothing is waited for.
        assert server.process.wait(HANGS) == 0


def test_bodies_that_have_not_arrived_at_sigterm_are_refused() -> None:
    with serving(PNS_WORKERS="1") as server:
        hanging = begin_upload(server, bytes(1000))
        server.process.send_signal(signal.SIGTERM)
        status, text = refusal(hanging)
        assert status == 503
        assert b'"draining"' in text
        assert server.process.wait(HANGS) == 0


@pytest.mark.parametrize("drain_seconds", ["600", "0.1"])
def test_a_second_sigterm_and_the_deadline_end_running_jobs_in_order(drain_seconds: str) -> None:
    with serving(PNS_WORKERS="1", PNS_DRAIN_SECONDS=drain_seconds) as server:
        server.wait_until_ready()
        # Many times as long as the test needs.
        query = "levels=5&model=full&compress=draco"
        under_way = begin_upload(server, part_glb(), query=query, whole=True)
        server.wait_until_a_job_runs()
        server.process.send_signal(signal.SIGTERM)
        if drain_seconds == "600":
            while server.status("/readyz") != 503:
                pass
            server.process.send_signal(signal.SIGTERM)
        status, text = refusal(under_way)
        assert status == 503
        assert b'"draining"' in text
        assert server.process.wait(HANGS) == 0
        assert "Traceback" not in server.whole_log()


def test_an_idle_server_stops_at_once() -> None:
    with serving(PNS_WORKERS="1") as server:
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(HANGS) == 0


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
