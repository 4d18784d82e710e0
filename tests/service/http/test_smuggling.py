"""No request hides in another: at the service alone and behind the proxy, over real sockets.

Each case is followed by a second request on its connection. Whether the case is refused or taken,
the second is answered once or never, and is never taken for a part of the first.
"""

import re
import socket

import pytest

from service.http.server import HEAD_BYTES
from tests.support.live import received

PATIENCE = 30
NEXT = b"GET /limits HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


def post(headers, body=b"", version=b"1.1"):
    return b"POST /subdivide HTTP/%b\r\nHost: localhost\r\n%b\r\n%b" % (version, headers, body)


def chunked(body):
    return post(b"Transfer-Encoding: chunked\r\n", body)


def get(head, path=b"/limits"):
    return b"GET %b HTTP/1.1\r\n%b\r\n" % (path, head)


def answers(front, sent):
    """The status of each answer, and all that was said, until the server ends the connection."""
    with socket.create_connection(front, timeout=PATIENCE) as connection:
        connection.sendall(sent)
        said = received(connection)
    return [int(status) for status in re.findall(rb"HTTP/1\.1 (\d{3}) ", said)], said


CASES = {
    "both lengths": post(b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n", b"0\r\n\r\n"),
    "two lengths": post(b"Content-Length: 0\r\nContent-Length: 9\r\n"),
    "a length with a sign": post(b"Content-Length: +0\r\n"),
    "a length of thousands of digits": post(b"Content-Length: " + b"9" * 5000 + b"\r\n"),
    "nearly chunked": post(b"Transfer-Encoding: xchunked\r\n", b"0\r\n\r\n"),
    "chunked twice": post(b"Transfer-Encoding: chunked\r\n" * 2, b"0\r\n\r\n"),
    "a space before the colon": post(b"Transfer-Encoding : chunked\r\n", b"0\r\n\r\n"),
    "chunked in HTTP/1.0": post(b"Transfer-Encoding: chunked\r\n", b"0\r\n\r\n", version=b"1.0"),
    "a folded line": get(b"Host: localhost\r\nX: b\r\n\tc\r\n"),
    "lines without CR": b"GET /limits HTTP/1.1\nHost: a\n\n",
    "NUL in a value": get(b"Host: localhost\r\nX: b\0c\r\n"),
    "two hosts": get(b"Host: localhost\r\nHost: b\r\n"),
    "no host": get(b""),
    "a chunk is longer than it says": chunked(b"1\r\nxyz\r\n0\r\n\r\n"),
    "a chunk's size with a sign": chunked(b"-1\r\nx\r\n0\r\n\r\n"),
    "a line end in a chunk's extension": chunked(b"1;a\nb\r\nx\r\n0\r\n\r\n"),
    "a trailer ends in LF": chunked(b"1\r\nx\r\n0\r\nX: a\n\n"),
    "a target of half an address": get(b"Host: localhost\r\n", b"http://[::1/limits"),
    "a target with a host, and two Hosts": get(
        b"Host: localhost\r\nHost: b\r\n", b"http://a/limits"
    ),
    "the preface of HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "a head that is too long": get(b"Host: localhost\r\n", b"/limits?" + b"a" * HEAD_BYTES),
    "trailers": chunked(b"0\r\nContent-Length: 99\r\nAuthorization: Bearer x\r\n\r\n"),
    "a body that nobody reads": get(b"Host: localhost\r\nContent-Length: 5\r\n") + b"hello",
    "an upgrade to HTTP/2": get(b"Host: localhost\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n"),
    "a path that climbs": get(b"Host: localhost\r\n", b"/" + b"%2e%2e%2f" * 1500),
    "a target with a body": (
        b"POST http://b/subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello"
    ),
    "many headers": get(b"Host: localhost\r\n" + b"".join(b"h%d: x\r\n" % n for n in range(1500))),
}


@pytest.mark.parametrize("case", CASES)
def test_no_request_hides_in_another(front, case):
    """One request in front of another: each is answered at most once, and by itself."""
    statuses, said = answers(front, CASES[case] + NEXT)
    assert 1 <= len(statuses) <= 2
    if len(statuses) == 2:
        assert statuses[1] in (200, 400)
    assert said.count(b"faces_per_minute") <= statuses.count(200)
