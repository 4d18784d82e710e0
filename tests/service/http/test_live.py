"""Promises over real connections: slow and vanishing clients, a server that stays awake."""

import socket
import struct
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.support.live import received, request_head, served, until

MIB = 2**20
GO_ON = b"HTTP/1.1 100 Continue\r\n\r\n"
CUT_OFF = "an answer is cut off: its client is too slow"
LARGE = f"large {48 * MIB}".encode().ljust(100)


@pytest.fixture(scope="module")
def address():
    limits = {"upload_seconds": 3, "stall_seconds": 1, "job_seconds": 3600}
    with served(workers=2, queue=4, body=64 * MIB, **limits) as where:
        yield where


def subdivide(client, body):
    return client.post("/subdivide", content=body)


def head_of(length, *more):
    return request_head(f"Content-Length: {length}", *more)


def test_healthz_answers_while_a_job_holds_its_interpreter(address, client):
    with socket.create_connection(address) as job:
        job.sendall(head_of(4) + b"hold")
        # A probe that waited for the job would never come back.
        assert [client.get("/healthz").status_code for _ in range(50)] == [200] * 50
        job.setblocking(False)
        with pytest.raises(BlockingIOError):
            job.recv(1)
    # Leaving has killed its worker.


def test_healthz_answers_while_a_large_body_is_taken_in(client):
    with ThreadPoolExecutor(1) as other:
        job = other.submit(subdivide, client, b"{}," * (16 * MIB // 3))
        probes = 0
        while not job.done():
            assert client.get("/healthz").status_code == 200
            probes += 1
    # Were it parsed in one go, one at most would be answered meanwhile.
    assert probes > 5


def test_a_client_that_leaves_during_its_upload_is_forgotten(address, client):
    for _ in range(6):
        with socket.create_connection(address) as connection:
            connection.sendall(head_of(100, "Expect: 100-continue"))
            # Now it reads the body.
            assert connection.recv(len(GO_ON), socket.MSG_WAITALL) == GO_ON
            connection.sendall(b"half")
    assert subdivide(client, b"here").content == b"here"


@pytest.mark.parametrize(("idle", "upload"), [(0.6, 60), (60, 1)])
def test_408_for_an_upload_that_stops_or_takes_too_long(idle, upload):
    with (
        served(workers=1, idle_seconds=idle, upload_seconds=upload) as where,
        socket.create_connection(where) as connection,
    ):
        connection.sendall(head_of(100))
        for _ in range(4):
            # Slow, but never idle.
            time.sleep(0.2)
            connection.sendall(b"some")
        answer = connection.recv(2**16)
        while b"upload-timeout" not in answer:
            piece = connection.recv(2**16)
            assert piece, answer
            answer += piece
    assert answer.startswith(b"HTTP/1.1 408 ")


def test_413_is_answered_before_the_body_is_sent(address):
    with socket.create_connection(address) as connection:
        connection.sendall(head_of(10**12, "Expect: 100-continue"))
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


def test_an_answer_larger_than_any_buffer_arrives_whole(client):
    answer = subdivide(client, LARGE)
    assert answer.headers["content-length"] == str(48 * MIB)
    assert len(answer.content) == 48 * MIB


def test_a_client_that_does_not_read_is_cut_off(address, client, caplog):
    with socket.create_connection(address) as connection:
        connection.sendall(head_of(len(LARGE)) + LARGE)
        # Nothing is read until the service has given up.
        until(lambda: CUT_OFF in caplog.messages)
        assert len(received(connection)) < 48 * MIB
    assert subdivide(client, b"here").content == b"here"


def test_clients_that_reset_their_connections_leave_no_fault_in_the_log(address, client, caplog):
    for sent, answered in (
        (b"GET /healthz HTT", 0),
        (head_of(100) + b"half", 0),
        (b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n", 1),
        (head_of(len(LARGE)) + LARGE, 1),
    ):
        with socket.create_connection(address) as connection:
            # Closed with what was not taken, so at once.
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.sendall(sent)
            assert len(connection.recv(answered)) == answered
    assert subdivide(client, b"here").content == b"here"
    assert [record for record in caplog.records if record.levelname == "ERROR"] == []
