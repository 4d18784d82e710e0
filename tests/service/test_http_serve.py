"""`pns serve` as its users run it: a process with an address, settings and signals."""

from __future__ import annotations

import http.client
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


def begin_upload(server: Server, body: bytes) -> http.client.HTTPConnection:
    connection = server.connect()
    connection.putrequest("POST", "/subdivide")
    connection.putheader("Content-Type", "model/gltf-binary")
    connection.putheader("Content-Length", str(len(body)))
    connection.endheaders()
    connection.send(body[: len(body) // 2])
    return connection


def test_a_request_under_way_at_sigterm_completes_and_new_ones_are_refused() -> None:
    body = part_glb()
    with serving(PNS_WORKERS="1") as server:
        server.wait_until_ready()
        under_way = begin_upload(server, body)
        time.sleep(0.3)
        # To the whole group, as a supervisor may do it: the workers must not take it as theirs.
        os.killpg(server.process.pid, signal.SIGTERM)
        time.sleep(0.3)
        assert server.status("/readyz") == 503
        assert server.status("/healthz") == 200
        late = begin_upload(server, body)
        refused = late.getresponse()
        assert refused.status == 503
        assert b'"draining"' in refused.read()

        under_way.send(body[len(body) // 2 :])
        answer = under_way.getresponse()
        assert answer.status == 200
        assert answer.read(4) == b"glTF"
        under_way.close()
        late.close()
        assert server.process.wait(20) == 0


def test_an_idle_server_stops_at_once() -> None:
    with serving(PNS_WORKERS="1") as server:
        began = time.monotonic()
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(20) == 0
        assert time.monotonic() - began < 10


def test_a_client_that_never_finishes_does_not_hold_the_shutdown() -> None:
    with serving(PNS_WORKERS="1", PNS_DRAIN_SECONDS="1") as server:
        hanging = begin_upload(server, bytes(1000))
        time.sleep(0.3)
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(20) == 0
        hanging.close()


def test_options_win_over_the_environment() -> None:
    with serving("--host", "127.0.0.2", PNS_HOST="127.0.0.3", PNS_WORKERS="1") as server:
        assert server.host == "127.0.0.2"
        assert server.status("/healthz") == 200
