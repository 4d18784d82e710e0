"""What only a real connection shows: slow and vanishing clients, and a server that stays awake."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx2
import pytest

from tests.service.live import served

GLB = {"Content-Type": "model/gltf-binary"}
MIB = 2**20


@pytest.fixture(scope="module")
def address() -> Iterator[tuple[str, int]]:
    with served(workers=2, queue=1, body=64 * MIB, upload_seconds=3, stall_seconds=1) as where:
        yield where


@pytest.fixture
def client(address: tuple[str, int]) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=f"http://{address[0]}:{address[1]}", timeout=60) as opened:
        yield opened


def subdivide(client: httpx2.Client, body: bytes) -> httpx2.Response:
    return client.post("/subdivide", content=body, headers=GLB)


def request_head(length: int, *, extra: str = "") -> bytes:
    return (
        "POST /subdivide HTTP/1.1\r\nHost: test\r\nContent-Type: model/gltf-binary\r\n"
        f"Content-Length: {length}\r\n{extra}\r\n"
    ).encode()


def received(connection: socket.socket) -> bytes:
    """All that the server sends before it closes."""
    connection.settimeout(10)
    return b"".join(iter(lambda: connection.recv(4096), b""))


def slowest_probe(client: httpx2.Client, until: threading.Event) -> float:
    slowest = 0.0
    while not until.is_set():
        began = time.perf_counter()
        assert client.get("/healthz").status_code == 200
        slowest = max(slowest, time.perf_counter() - began)
        time.sleep(0.01)
    return slowest


@pytest.mark.parametrize("body", [b"hold", b"{}," * (64 * MIB // 3)], ids=["hold", "64 MiB"])
def test_healthz_answers_whatever_the_workers_do(client: httpx2.Client, body: bytes) -> None:
    finished = threading.Event()
    with ThreadPoolExecutor(1) as probes:
        slowest = probes.submit(slowest_probe, client, finished)
        try:
            client.post("/subdivide", content=body, headers=GLB, timeout=2)
        except httpx2.ReadTimeout:
            # The job that holds its interpreter never answers; leaving kills its worker.
            assert body == b"hold"
        finished.set()
        # Measured: a few milliseconds. A probe that waited for the job would take seconds.
        assert slowest.result() < 1


def test_a_client_that_leaves_frees_its_worker(client: httpx2.Client) -> None:
    for _ in range(4):
        # Twice as many as there are workers, and more than the queue holds.
        with pytest.raises(httpx2.ReadTimeout):
            client.post("/subdivide", content=b"sleep 60", headers=GLB, timeout=0.3)
        time.sleep(0.2)
    assert subdivide(client, b"here").content == b"here"


def test_a_client_that_leaves_during_its_upload_is_forgotten(
    address: tuple[str, int], client: httpx2.Client
) -> None:
    for _ in range(6):
        with socket.create_connection(address) as connection:
            connection.sendall(request_head(100) + b"half")
    time.sleep(0.2)
    assert subdivide(client, b"here").content == b"here"


def test_503_with_retry_after_when_every_place_is_taken(client: httpx2.Client) -> None:
    with ThreadPoolExecutor(3) as others:
        running = [others.submit(subdivide, client, b"sleep 1.5") for _ in range(3)]
        time.sleep(0.7)
        refused = subdivide(client, b"one too many")
        assert refused.status_code == 503
        assert refused.json()["code"] == "busy"
        assert int(refused.headers["retry-after"]) >= 1
        assert [request.result().status_code for request in running] == [200, 200, 200]


def test_408_for_an_upload_that_trickles(address: tuple[str, int]) -> None:
    with socket.create_connection(address) as connection:
        connection.sendall(request_head(100) + b"some")
        answer = received(connection)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"upload-timeout" in answer


def test_408_for_an_upload_that_stops() -> None:
    with (
        served(workers=1, idle_seconds=1, upload_seconds=60) as where,
        socket.create_connection(where) as connection,
    ):
        connection.sendall(request_head(100))
        for _ in range(4):
            # Slow, but never idle.
            time.sleep(0.4)
            connection.sendall(b"some")
        began = time.monotonic()
        answer = received(connection)
        assert time.monotonic() - began < 5
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"nothing of the body arrived" in answer


def test_idle_uploads_refuse_nobody(address: tuple[str, int], client: httpx2.Client) -> None:
    idle = [socket.create_connection(address) for _ in range(10)]
    try:
        for connection in idle:
            connection.sendall(request_head(100) + b"half")
        time.sleep(0.3)
        assert subdivide(client, b"here").content == b"here"
    finally:
        for connection in idle:
            connection.close()


def test_503_for_more_uploads_than_are_taken() -> None:
    with (
        served(workers=1, uploads=1) as where,
        socket.create_connection(where) as idle,
        httpx2.Client(base_url=f"http://{where[0]}:{where[1]}", timeout=60) as client,
    ):
        idle.sendall(request_head(100) + b"half")
        time.sleep(0.3)
        refused = subdivide(client, b"one too many")
        assert refused.status_code == 503
        assert refused.json()["code"] == "busy"


def test_413_is_answered_before_the_body_is_sent(address: tuple[str, int]) -> None:
    with socket.create_connection(address) as connection:
        connection.sendall(request_head(10**12, extra="Expect: 100-continue\r\n"))
        connection.settimeout(10)
        answer = connection.recv(4096)
    assert answer.startswith(b"HTTP/1.1 413 ")


def test_an_endless_chunked_upload_is_cut_off_at_the_limit(address: tuple[str, int]) -> None:
    head = (
        b"POST /subdivide HTTP/1.1\r\nHost: test\r\nContent-Type: model/gltf-binary\r\n"
        b"Transfer-Encoding: chunked\r\n\r\n"
    )
    chunk = b"100000\r\n" + bytes(MIB) + b"\r\n"
    sent = 0
    with socket.create_connection(address) as connection:
        connection.settimeout(10)
        connection.sendall(head)
        try:
            for _ in range(400):
                connection.sendall(chunk)
                sent += MIB
        except OSError:
            pass
    # The sockets' buffers may hold a little more than what was read.
    assert sent <= 80 * MIB


def test_an_answer_larger_than_any_buffer_arrives_whole(client: httpx2.Client) -> None:
    answer = subdivide(client, f"large {48 * MIB}".encode().ljust(100))
    assert answer.headers["content-length"] == str(48 * MIB)
    assert len(answer.content) == 48 * MIB


def test_a_client_that_does_not_read_is_cut_off(
    address: tuple[str, int], client: httpx2.Client
) -> None:
    body = f"large {48 * MIB}".encode().ljust(100)
    with socket.create_connection(address) as connection:
        connection.sendall(request_head(len(body)) + body)
        time.sleep(3)
        connection.settimeout(10)
        received = 0
        while piece := connection.recv(MIB):
            received += len(piece)
    assert received < 48 * MIB
    assert subdivide(client, b"here").content == b"here"
