"""`pns serve` as its users run it: a process with an address, settings and signals."""

from __future__ import annotations

import http.client
import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import IO, NamedTuple
from unittest.mock import Mock

import httpx2
import pytest
import uvicorn

from service.http.server import PromptServer
from service.meshfiles.example import part_glb
from tests.support.added_scheme import TRIANGLE, halved, with_linear
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
        return http.client.HTTPConnection(self.host, self.port, timeout=600)

    def get(self, path: str) -> tuple[int, bytes]:
        with closing(self.connect()) as connection:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def status(self, path: str) -> int:
        return self.get(path)[0]

    def wait_until_ready(self) -> None:
        while self.status("/readyz") != 200:
            time.sleep(0.05)

    def wait_until_a_job_runs(self) -> None:
        told = METRICS.search(self.log)
        assert told is not None
        while "pns_jobs_running 1.0" not in httpx2.get(told[1]).text:
            time.sleep(0.01)


@contextmanager
def serving(*arguments: str, stdout: int | None = None, **environment: str) -> Iterator[Server]:
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


def answered(connection: http.client.HTTPConnection) -> tuple[int, bytes]:
    with closing(connection):
        answer = connection.getresponse()
        return answer.status, answer.read()


class Drained(NamedTuple):
    """The answers of a server to its clients after SIGTERM, and its exit."""

    default: list[str]
    late: tuple[int, bytes]
    healthy: int
    kept: bool
    half_sent: tuple[int, bytes]
    under_way: tuple[int, bytes]
    job: tuple[int, bytes]
    code: int


@pytest.fixture(scope="module")
def drained() -> Drained:
    """A server with a request that runs, a job that waits and a body that is half sent."""
    body = part_glb()
    with serving("--model", "paper", PNS_WORKERS="1", PNS_MODEL="missing.onnx") as server:
        server.wait_until_ready()
        default = default_models(server)
        half_sent = begin_upload(server, bytes(1000))
        under_way = begin_upload(server, body, query="levels=5", whole=True)
        server.wait_until_a_job_runs()
        with closing(server.connect()) as connection:
            glb = {"Content-Type": "model/gltf-binary"}
            connection.request("POST", "/jobs?levels=4", body, glb)
            job = f"/jobs/{json.loads(connection.getresponse().read())['id']}"
        # To the whole group, as a supervisor may do it: the workers must not take it as theirs.
        os.killpg(server.process.pid, signal.SIGTERM)
        while server.status("/readyz") != 503:
            pass
        late = answered(begin_upload(server, body))
        with closing(server.connect()) as connection:
            connection.request("GET", "/healthz")
            answer = connection.getresponse()
            healthy, kept = answer.status, not answer.will_close
        refused = answered(half_sent)
        completed = answered(under_way)
        # The first that is no 409 is the result: it has been fetched.
        while (fetched := server.get(f"{job}/result"))[0] == 409:
            time.sleep(0.01)
        code = server.process.wait(HANGS)
    return Drained(default, late, healthy, kept, refused, completed, fetched, code)


def default_models(server: Server) -> list[str]:
    """Names of the listed models that are the default."""
    listed = json.loads(server.get("/models")[1])
    return [entry["name"] for entry in listed if entry["default"]]


@pytest.mark.parametrize(("host", "opened"), [("127.0.0.1", True), ("0.0.0.0", False)])
def test_a_line_names_the_address_to_open_where_this_machine_alone_is_served(
    host: str, opened: bool
) -> None:
    with serving("--host", host, stdout=subprocess.PIPE) as server:
        server.process.terminate()
        assert server.process.stdout is not None
        said = server.process.stdout.read()
    assert said == (f"Open http://127.0.0.1:{server.port}\n" if opened else "")


def test_a_file_and_a_line_make_a_base_scheme_known_over_http(tmp_path: Path) -> None:
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
            connection.request("POST", f"/jobs?{query}", TRIANGLE, obj)
            answer = connection.getresponse()
            assert answer.status == 202, answer.read()


def test_the_service_survives_more_connections_at_once_than_it_has_descriptors() -> None:
    with serving(PNS_CONNECTIONS="16") as server:
        server.wait_until_ready()
        process = server.process.pid
        most = len(list(Path(f"/proc/{process}/fd").iterdir())) + 200
        resource.prlimit(process, resource.RLIMIT_NOFILE, (most, most))
        # While it sleeps they wait in the system, and then they are all there in one turn.
        os.kill(process, signal.SIGSTOP)
        burst = [socket.create_connection((server.host, server.port)) for _ in range(400)]
        os.kill(process, signal.SIGCONT)
        # They say nothing, and end one after the other.
        while True:
            with suppress(OSError, http.client.HTTPException):
                if server.status("/healthz") == 200:
                    break
            time.sleep(0.1)
        for connection in burst:
            connection.close()
        server.process.terminate()


def test_a_request_under_way_at_sigterm_completes(drained: Drained) -> None:
    status, content = drained.under_way
    assert (status, content[:4]) == (200, b"glTF")


def test_new_requests_after_sigterm_are_refused_and_probes_are_not(drained: Drained) -> None:
    assert drained.late[0] == 503
    assert b'"draining"' in drained.late[1]
    # Before its body, not with those whose body has not arrived.
    assert b"no new request is taken" in drained.late[1]
    assert drained.healthy == 200


def test_no_connection_is_kept_after_sigterm_whose_next_request_would_meet_the_end(
    drained: Drained,
) -> None:
    assert not drained.kept


def test_a_job_at_sigterm_completes_and_waits_to_be_fetched(drained: Drained) -> None:
    """It had not even begun. Once it is fetched nothing is waited for."""
    status, content = drained.job
    assert (status, content[:4]) == (200, b"glTF")
    assert drained.code == 0


def test_bodies_that_have_not_arrived_at_sigterm_are_refused(drained: Drained) -> None:
    assert drained.half_sent[0] == 503
    assert b'"draining"' in drained.half_sent[1]
    assert b"the request was ended" in drained.half_sent[1]


@pytest.mark.parametrize("drain_seconds", ["600", "0.1"])
def test_a_second_sigterm_and_the_deadline_end_running_jobs_in_order(drain_seconds: str) -> None:
    with serving(PNS_WORKERS="1", PNS_DRAIN_SECONDS=drain_seconds) as server:
        server.wait_until_ready()
        # Many times as long as the test needs.
        query = "levels=5&model=signed&compress=draco"
        under_way = begin_upload(server, part_glb(), query=query, whole=True)
        server.wait_until_a_job_runs()
        server.process.send_signal(signal.SIGTERM)
        if drain_seconds == "600":
            while server.status("/readyz") != 503:
                pass
            server.process.send_signal(signal.SIGTERM)
        status, text = answered(under_way)
        assert status == 503
        assert b'"draining"' in text
        assert server.process.wait(HANGS) == 0
        assert "Traceback" not in server.whole_log()


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGHUP])
def test_a_job_that_ended_just_before_a_signal_waits_to_be_fetched_too(
    sent: signal.Signals,
) -> None:
    """SIGHUP: the terminal is closed. Its shell tells of it, and then the system again."""
    if signal.getsignal(sent) is signal.SIG_IGN:
        pytest.skip("this runs under nohup, whose processes ignore it")
    with serving(PNS_WORKERS="1") as server:
        server.wait_until_ready()
        with closing(server.connect()) as connection:
            glb = {"Content-Type": "model/gltf-binary"}
            connection.request("POST", "/jobs?scheme=loop", part_glb(), glb)
            job = f"/jobs/{json.loads(connection.getresponse().read())['id']}"
        while b'"done"' not in server.get(job)[1]:
            time.sleep(0.01)
        server.process.send_signal(sent)
        if sent == signal.SIGHUP:
            while server.status("/readyz") != 503:
                pass
            server.process.send_signal(sent)
        # Long enough that a server which waits for nobody is gone.
        for _ in range(20):
            assert server.status("/healthz") == 200
            time.sleep(0.02)
        assert server.get(f"{job}/result")[0] == 200
        assert server.process.wait(HANGS) == 0


def connected(*, asked: bool = True, more_body: bool = False, began: bytes = b"") -> Mock:
    """A connection as uvicorn keeps it; with or without a request before."""
    cycle = SimpleNamespace(response_complete=True, more_body=more_body)
    transport = Mock(**{"is_closing.return_value": False, "get_write_buffer_size.return_value": 0})
    conn = SimpleNamespace(trailing_data=(began, False))
    return Mock(cycle=cycle if asked else None, conn=conn, transport=transport)


def test_in_a_crowd_idle_connections_end_but_none_on_which_a_request_may_be_under_way() -> None:
    """A proxy keeps connections between two requests, and may send the next at any moment."""
    server = PromptServer(uvicorn.Config("unused:app"), head_seconds=10, most=0)
    every = [connected(), connected(asked=False), connected(more_body=True), connected(began=b"G")]
    server.server_state.connections = set(every)
    for now, ended in (0.0, [False] * 4), (1.0, [False, True, True, True]), (11.0, [True] * 4):
        server._end_idle(now)
        assert [one.transport.abort.called for one in every] == ended


def test_an_idle_server_stops_at_once() -> None:
    with serving(PNS_WORKERS="1") as server:
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(HANGS) == 0


def test_options_win_over_the_environment(drained: Drained, tmp_path: Path) -> None:
    """The host, and the served model: a name (of the server before) or a file."""
    assert drained.default == ["paper"]
    mine = served_file(tmp_path / "mine.onnx")
    given = ("--host", "127.0.0.2", "--model", mine)
    with serving(*given, PNS_HOST="127.0.0.3", PNS_WORKERS="1", PNS_MODEL="missing.onnx") as server:
        assert server.host == "127.0.0.2"
        server.wait_until_ready()
        assert default_models(server) == ["mine"]
