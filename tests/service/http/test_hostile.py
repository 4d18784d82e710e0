"""Hostile clients at the service alone, and behind the proxy of deploy/; over real sockets.

Nothing here measures time: a test waits for an answer or an end, and each socket gives up after
`PATIENCE` where neither comes. What the service leaves to a proxy is tested behind it alone.
"""

import http.client
import json
import re
import socket
import time
from contextlib import ExitStack, closing, suppress

import pytest

from service.http.server import HEAD_BYTES
from tests.support.live import GLB, received, request_head, served
from tests.support.proxy import proxied

PATIENCE = 60
MIB = 2**20


def connect(address):
    return socket.create_connection(address, timeout=PATIENCE)


def posted(address, body, **options):
    """Status and content of the answer to a client that means well."""
    with closing(http.client.HTTPConnection(*address, timeout=PATIENCE)) as connection:
        connection.request("POST", "/subdivide", body, GLB, **options)
        answer = connection.getresponse()
        return answer.status, answer.read()


def wait_until_served(address):
    for _ in range(200):
        with suppress(OSError, http.client.HTTPException):
            if posted(address, b"honest") == (200, b"honest"):
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
    status, content = posted(front, bytes(size))
    assert (status, json.loads(content)["limit"]) == (413, "body")


def test_a_chunked_body_in_ordinary_pieces_is_taken(front):
    pieces = [bytes([n]) * 1024 for n in range(250)]
    assert posted(front, iter(pieces), encode_chunked=True) == (200, b"".join(pieces))


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
        assert posted(address, b"honest") == (200, b"honest")


# No request hides in another. Each of these is followed by a second one on its connection.

NEXT = b"GET /limits HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


def post(headers, body=b"", version=b"1.1"):
    return b"POST /subdivide HTTP/%b\r\nHost: localhost\r\n%b\r\n%b" % (version, headers, body)


def chunked(body):
    return post(b"Transfer-Encoding: chunked\r\n", body)


def get(head, path=b"/limits"):
    return b"GET %b HTTP/1.1\r\n%b\r\n" % (path, head)


HOST, END = b"Host: localhost\r\n", b"0\r\n\r\n"
HIDING = {
    "both lengths": post(b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n", END),
    "two lengths": post(b"Content-Length: 0\r\nContent-Length: 9\r\n"),
    "a length with a sign": post(b"Content-Length: +0\r\n"),
    "a length of thousands of digits": post(b"Content-Length: " + b"9" * 5000 + b"\r\n"),
    "nearly chunked": post(b"Transfer-Encoding: xchunked\r\n", END),
    "chunked twice": post(b"Transfer-Encoding: chunked\r\n" * 2, END),
    "a space before the colon": post(b"Transfer-Encoding : chunked\r\n", END),
    "chunked in HTTP/1.0": post(b"Transfer-Encoding: chunked\r\n", END, version=b"1.0"),
    "a folded line": get(HOST + b"X: b\r\n\tc\r\n"),
    "lines without CR": b"GET /limits HTTP/1.1\nHost: a\n\n",
    "NUL in a value": get(HOST + b"X: b\0c\r\n"),
    "two hosts": get(HOST + b"Host: b\r\n"),
    "no host": get(b""),
    "a chunk is longer than it says": chunked(b"1\r\nxyz\r\n" + END),
    "a chunk's size with a sign": chunked(b"-1\r\nx\r\n" + END),
    "a line end in a chunk's extension": chunked(b"1;a\nb\r\nx\r\n" + END),
    "a trailer ends in LF": chunked(b"1\r\nx\r\n0\r\nX: a\n\n"),
    "a target of half an address": get(HOST, b"http://[::1/limits"),
    "a target with a host, and two Hosts": get(HOST + b"Host: b\r\n", b"http://a/limits"),
    "the preface of HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "a head that is too long": get(HOST, b"/limits?" + b"a" * HEAD_BYTES),
    "trailers": chunked(b"0\r\nContent-Length: 99\r\nAuthorization: Bearer x\r\n\r\n"),
    "a body that nobody reads": get(HOST + b"Content-Length: 5\r\n") + b"hello",
    "an upgrade to HTTP/2": get(HOST + b"Connection: Upgrade\r\nUpgrade: h2c\r\n"),
    "a path that climbs": get(HOST, b"/" + b"%2e%2e%2f" * 1500),
    "a target with a body": (
        b"POST http://b/subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello"
    ),
    "many headers": get(HOST + b"".join(b"h%d: x\r\n" % n for n in range(1500))),
}


@pytest.mark.parametrize("case", HIDING)
def test_no_request_hides_in_another(front, case):
    """The second is answered once or never, and by itself, whatever becomes of the first."""
    with connect(front) as connection:
        connection.sendall(HIDING[case] + NEXT)
        said = received(connection)
    statuses = [int(status) for status in re.findall(rb"HTTP/1\.1 (\d{3}) ", said)]
    assert 1 <= len(statuses) <= 2
    assert statuses[1:] in ([], [200], [400])
    assert said.count(b"faces_per_minute") <= statuses.count(200)
