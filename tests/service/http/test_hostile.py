"""Hostile clients at the service alone, and behind the proxy of deploy/; over real sockets.

Nothing here measures time: a test waits for an answer or an end, and each socket gives up after
`PATIENCE` where neither comes. What the service leaves to a proxy is tested behind it alone.
"""

from __future__ import annotations

import http.client
import json
import socket
import time
from contextlib import ExitStack, closing, suppress

import pytest

from tests.support.live import GLB, received, request_head, served
from tests.support.proxy import proxied

PATIENCE = 60
MIB = 2**20


def connect(address):
    return socket.create_connection(address, timeout=PATIENCE)


def is_served(address):
    """Return whether a client that means well is served."""
    with closing(http.client.HTTPConnection(*address, timeout=PATIENCE)) as connection:
        connection.request("POST", "/subdivide", b"honest", GLB)
        answer = connection.getresponse()
        return (answer.status, answer.read()) == (200, b"honest")


def wait_until_served(address):
    for _ in range(200):
        with suppress(OSError, http.client.HTTPException):
            if is_served(address):
                return
        time.sleep(0.1)
    pytest.fail("the service does not recover")


@pytest.mark.parametrize("target", ["GET /healthz", "POST /nothing", "POST /subdivide?levels=9"])
# Alone uvicorn reads such a body to its end, and drops it.
@pytest.mark.parametrize("front", ["behind the proxy"], indirect=True)
def test_a_body_that_no_route_reads_ends_and_is_kept_nowhere(front, target):
    chunk = b"10000\r\n" + bytes(2**16) + b"\r\n"
    with connect(front) as connection:
        connection.sendall(request_head("Transfer-Encoding: chunked", target=target))
        # Reset, or a broken pipe.
        with pytest.raises(OSError):  # noqa: PT011, PT012
            while True:
                connection.sendall(chunk)
    wait_until_served(front)


@pytest.mark.parametrize("size", [MIB + 1, 3 * MIB])
def test_a_client_that_sends_first_and_reads_later_sees_its_413(front, size):
    with closing(http.client.HTTPConnection(*front, timeout=PATIENCE)) as connection:
        connection.request("POST", "/subdivide", bytes(size), GLB)
        answer = connection.getresponse()
        assert answer.status == 413
        assert json.loads(answer.read())["limit"] == "body"


def test_a_chunked_body_in_ordinary_pieces_is_taken(front):
    pieces = [bytes([n]) * 1024 for n in range(250)]
    with closing(http.client.HTTPConnection(*front, timeout=PATIENCE)) as connection:
        connection.request("POST", "/subdivide", iter(pieces), GLB, encode_chunked=True)
        answer = connection.getresponse()
        assert (answer.status, answer.read()) == (200, b"".join(pieces))


@pytest.mark.parametrize(
    "sent",
    [
        b"secret\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nKey : secret\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 2**18,
        b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: gzip\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(64),
    ],
    ids=["words", "no host", "a blank in a name", "a long head", "an encoding", "TLS"],
)
def test_what_is_no_http_is_refused_and_not_repeated_in_the_log(front, sent, caplog):
    with connect(front) as connection:
        with suppress(OSError):
            connection.sendall(sent)
        answer = received(connection)
    assert b" 200 " not in answer[:20]
    # What could not be read may have been a key.
    assert "secret" not in caplog.text
    wait_until_served(front)


def test_behind_the_proxy_one_address_that_fills_its_share_keeps_nobody_out(tmp_path):
    with (
        served(workers=1, proxies="127.0.0.1") as behind,
        proxied(behind, tmp_path) as address,
        ExitStack() as opened,
    ):
        upload = request_head("Content-Length: 1000", "X-Client: 192.0.2.1")
        for _ in range(100):
            connection = opened.enter_context(connect(address))
            with suppress(OSError):
                connection.sendall(upload)
        assert is_served(address)
