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
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

import httpx2
import pytest

from service.meshfiles.example import part_glb
from tests.support.added_scheme import TRIANGLE, halved, with_linear
from tests.support.live import HANGS, until
from tests.support.packages import served_file

PNS = Path(sys.executable).with_name("pns")
ADDRESS = re.compile(r"running on http://([\d.]+):(\d+)")
METRICS = re.compile(r"metrics on (http://\S+/metrics)")
GO_ON = b"HTTP/1.1 100 Continue\r\n\r\n"


class Server:
    """A running `pns serve`."""

    def __init__(self, process):
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

    def _read(self, log):
        for line in log:
            self.log += line

    def whole_log(self):
        """All that it said; it has ended."""
        self._rest.join()
        return self.log

    def connect(self):
        return http.client.HTTPConnection(self.host, self.port, timeout=600)

    def get(self, path):
        with closing(self.connect()) as connection:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def wait_until_ready(self):
        until(lambda: self.get("/readyz")[0] == 200)

    def wait_until_a_job_runs(self):
        told = METRICS.search(self.log)
        assert told is not None
        until(lambda: "pns_jobs_running 1.0" in httpx2.get(told[1]).text)


@contextmanager
def serving(*arguments, stdout=None, **environment):
    process = subprocess.Popen(
        [str(PNS), "serve", "--port", "0", *arguments],
        stdout=stdout,
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


def begin_upload(server, body, *, query="", whole=False):
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


def answered(connection):
    with closing(connection):
        answer = connection.getresponse()
        return answer.status, answer.read()


class Drained(NamedTuple):
    """The models of a server, the answer to its client after SIGTERM, and its exit."""

    default: list[str]
    under_way: tuple[int, bytes]
    code: int


@pytest.fixture(scope="module")
def drained():
    """A server that is ended while a request runs."""
    with serving("--model", "paper", PNS_WORKERS="1", PNS_MODEL="missing.onnx") as server:
        server.wait_until_ready()
        default = default_models(server)
        under_way = begin_upload(server, part_glb(), query="levels=5", whole=True)
        server.wait_until_a_job_runs()
        # To the whole group, as a supervisor may do it: the workers must not take it as theirs.
        os.killpg(server.process.pid, signal.SIGTERM)
        completed = answered(under_way)
        code = server.process.wait(HANGS)
    return Drained(default, completed, code)


def default_models(server):
    """Names of the listed models that are the default."""
    listed = json.loads(server.get("/models")[1])
    return [entry["name"] for entry in listed if entry["default"]]


@pytest.mark.parametrize(("host", "opened"), [("127.0.0.1", True), ("0.0.0.0", False)])
def test_a_line_names_the_address_to_open_where_this_machine_alone_is_served(host, opened):
    with serving("--host", host, stdout=subprocess.PIPE) as server:
        server.process.terminate()
        assert server.process.stdout is not None
        said = server.process.stdout.read()
        # Idle, it stops at once.
        assert server.process.wait(HANGS) == 0
    assert said == (f"Open http://127.0.0.1:{server.port}\n" if opened else "")


def test_a_file_and_a_line_make_a_base_scheme_known_over_http(tmp_path):
    with serving(PNS_WORKERS="1", **with_linear(tmp_path)) as server:
        server.wait_until_ready()
        assert json.loads(server.get("/limits")[1])["schemes"] == [
            "loop",
            "catmull-clark",
            "linear",
        ]
        query, obj = "scheme=linear&levels=1", {"Content-Type": "model/obj"}
        with closing(server.connect()) as connection:
            connection.request("POST", f"/subdivide?{query}&format=obj", TRIANGLE, obj)
            refined = connection.getresponse().read().decode()
            assert halved(refined), refined
            connection.request("POST", f"/report?{query}", TRIANGLE, obj)
            assert json.loads(connection.getresponse().read())["base"] == "linear"


def test_a_request_under_way_at_sigterm_completes(drained):
    status, content = drained.under_way
    assert (status, content[:4]) == (200, b"glTF")
    assert drained.code == 0


def test_options_win_over_the_environment(drained, tmp_path):
    """The host, and the served model: a name (of the server before) or a file."""
    assert drained.default == ["paper"]
    mine = served_file(tmp_path / "mine.onnx")
    given = ("--host", "127.0.0.2", "--model", mine)
    with serving(*given, PNS_HOST="127.0.0.3", PNS_WORKERS="1", PNS_MODEL="missing.onnx") as server:
        assert server.host == "127.0.0.2"
        server.wait_until_ready()
        assert default_models(server) == ["mine"]


def test_the_deadline_ends_what_runs_and_its_worker():
    with serving(PNS_WORKERS="1", PNS_DRAIN_SECONDS="1") as server:
        server.wait_until_ready()
        # Many times as long as the test needs.
        query = "levels=5&model=signed&compress=draco"
        under_way = begin_upload(server, part_glb(), query=query, whole=True)
        sends = begin_upload(server, part_glb(), query=query)
        server.wait_until_a_job_runs()
        server.process.send_signal(signal.SIGTERM)
        assert [answered(each)[0] for each in (under_way, sends)] == [503, 503]
        assert server.process.wait(HANGS) == 0
    assert "Traceback" not in server.whole_log()
