"""No request hides in another: what two readers may read differently is refused, over real sockets.

Each case is followed by a second request on its connection. A case that is refused ends the
connection, so that the second is never answered; one that is taken leaves the second what it is.
"""

import re
import socket

import pytest

from service.http.connection.protocol import HEAD_BYTES
from tests.support.live import served

PATIENCE = 30
NEXT = b"GET /limits HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"


@pytest.fixture(scope="module")
def address():
    with served(workers=1) as where:
        yield where


def post(headers, body=b"", version=b"1.1"):
    return b"POST /subdivide HTTP/%b\r\nHost: localhost\r\n%b\r\n%b" % (version, headers, body)


def chunked(body):
    return post(b"Transfer-Encoding: chunked\r\n", body)


def get(head, path=b"/limits"):
    return b"GET %b HTTP/1.1\r\n%b\r\n" % (path, head)


def answers(address, sent):
    """The status of each answer, and all that was said, until the server ends the connection."""
    with socket.create_connection(address, timeout=PATIENCE) as connection:
        connection.sendall(sent)
        said = b""
        while piece := connection.recv(2**16):
            said += piece
    return [int(status) for status in re.findall(rb"HTTP/1\.1 (\d{3}) ", said)], said


REFUSED = {
    "both lengths": (
        post(b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n", b"0\r\n\r\n"),
        400,
    ),
    "both lengths, chunked first": (
        post(b"Transfer-Encoding: chunked\r\nContent-Length: 5\r\n", b"0\r\n\r\n"),
        400,
    ),
    "two lengths": (post(b"Content-Length: 0\r\nContent-Length: 9\r\n"), 400),
    "a list of lengths": (post(b"Content-Length: 0, 9\r\n"), 400),
    "a length with a sign": (post(b"Content-Length: +0\r\n"), 400),
    "a length in base 16": (post(b"Content-Length: 0x0\r\n"), 400),
    "a length in other digits": (post("Content-Length: ٠\r\n".encode()), 400),
    "a length of thousands of digits": (post(b"Content-Length: " + b"9" * 5000 + b"\r\n"), 400),
    "nearly chunked": (post(b"Transfer-Encoding: xchunked\r\n", b"0\r\n\r\n"), 501),
    "chunked and more": (post(b"Transfer-Encoding: identity, chunked\r\n", b"0\r\n\r\n"), 501),
    "chunked twice": (post(b"Transfer-Encoding: chunked\r\n" * 2, b"0\r\n\r\n"), 501),
    "a space before the colon": (post(b"Transfer-Encoding : chunked\r\n", b"0\r\n\r\n"), 400),
    "chunked behind a control": (post(b"Transfer-Encoding:\x0bchunked\r\n", b"0\r\n\r\n"), 400),
    "chunked in HTTP/1.0": (
        post(b"Transfer-Encoding: chunked\r\n", b"0\r\n\r\n", version=b"1.0"),
        400,
    ),
    "a folded length": (post(b"Transfer-Encoding:\r\n chunked\r\n", b"0\r\n\r\n"), 400),
    "a folded line": (get(b"Host: localhost\r\nX: b\r\n\tc\r\n"), 400),
    "lines without CR": (b"GET /limits HTTP/1.1\nHost: a\n\n", 400),
    "one line without CR": (get(b"Host: localhost\r\nX: b\nY: c\r\n"), 400),
    "lines without LF": (b"GET /limits HTTP/1.1\rHost: localhost\r\r\n\r\n", 400),
    "CR in a value": (get(b"Host: localhost\r\nX: b\rContent-Length: 9\r\n"), 400),
    "NUL in a value": (get(b"Host: localhost\r\nX: b\0c\r\n"), 400),
    "two hosts": (get(b"Host: localhost\r\nHost: b\r\n"), 400),
    "no host": (get(b""), 400),
    "a line without colon": (get(b"Host: localhost\r\nnonsense\r\n"), 400),
    "a chunk's size ends in LF": (chunked(b"1\nx\r\n0\r\n\r\n"), 400),
    "a chunk ends in LF": (chunked(b"1\r\nx\n0\r\n\r\n"), 400),
    "a chunk is longer than it says": (chunked(b"1\r\nxyz\r\n0\r\n\r\n"), 400),
    "a chunk's size with a sign": (chunked(b"-1\r\nx\r\n0\r\n\r\n"), 400),
    "a chunk's size with 0x": (chunked(b"0x1\r\nx\r\n0\r\n\r\n"), 400),
    "a chunk's size behind a space": (chunked(b" 1\r\nx\r\n0\r\n\r\n"), 400),
    "a line end in a chunk's extension": (chunked(b"1;a\nb\r\nx\r\n0\r\n\r\n"), 400),
    "the last chunk ends in LF": (chunked(b"1\r\nx\r\n0\n\r\n"), 400),
    "a body ends in LF": (chunked(b"1\r\nx\r\n0\r\n\n"), 400),
    "a trailer ends in LF": (chunked(b"1\r\nx\r\n0\r\nX: a\n\n"), 400),
    "a target of no host": (get(b"Host: localhost\r\n", b"http:///limits"), 400),
    "a target of a user": (get(b"Host: localhost\r\n", b"http://u:p@a/limits"), 400),
    "a target of half an address": (get(b"Host: localhost\r\n", b"http://[::1/limits"), 400),
    "a target with a host, and no Host": (get(b"", b"http://a/limits"), 400),
    "a target with a host, and two Hosts": (
        get(b"Host: localhost\r\nHost: b\r\n", b"http://a/limits"),
        400,
    ),
    "the preface of HTTP/2": (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 505),
    "a head that is too long": (get(b"Host: localhost\r\n", b"/limits?" + b"a" * HEAD_BYTES), 431),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_may_be_read_in_two_ways_is_refused_and_ends_the_connection(address, case):
    sent, expected = REFUSED[case]
    statuses, said = answers(address, sent + NEXT)
    # What the route says of a body that it does not wait for may come first; nothing comes after.
    assert statuses in ([expected], [415])
    assert b"queue_seconds" not in said


TAKEN = {
    "extensions of chunks": (chunked(b"1;a=b\r\nx\r\n0;c\r\n\r\n"), 415),
    "trailers": (chunked(b"0\r\nContent-Length: 99\r\nAuthorization: Bearer x\r\n\r\n"), 415),
    "the same length twice": (post(b"Content-Length: 0\r\n" * 2), 415),
    "a body that nobody reads": (get(b"Host: localhost\r\nContent-Length: 5\r\n") + b"hello", 200),
    "an upgrade to HTTP/2": (
        get(b"Host: localhost\r\nConnection: Upgrade\r\nUpgrade: h2c\r\n"),
        200,
    ),
    "a long query": (get(b"Host: localhost\r\n", b"/limits?" + b"a" * 15000), 200),
    "a long path": (get(b"Host: localhost\r\n", b"/" + b"a/" * 7000), 404),
    "a path that climbs": (get(b"Host: localhost\r\n", b"/" + b"%2e%2e%2f" * 1500), 404),
    "a target with a host": (get(b"Host: localhost\r\n", b"http://b.example:80/limits?x=1"), 200),
    "a target with an address": (get(b"Host: localhost\r\n", b"HTTPS://[::1]/limits"), 200),
    "a target of another protocol": (get(b"Host: localhost\r\n", b"ftp://b/limits"), 404),
    "a path of a target": (get(b"Host: localhost\r\n", b"/http://b/limits"), 404),
    "a target with two slashes": (get(b"Host: localhost\r\n", b"http://b//limits"), 404),
    "a target with a body": (
        b"POST http://b/subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello",
        415,
    ),
    "many headers": (
        get(b"Host: localhost\r\n" + b"".join(b"h%d: x\r\n" % n for n in range(1500))),
        200,
    ),
    "many parameters": (
        b"POST /subdivide?%b HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"
        % b"&".join(b"levels=%d" % n for n in range(1200)),
        422,
    ),
}


@pytest.mark.parametrize("case", TAKEN)
def test_what_reads_in_one_way_alone_leaves_the_next_request_alone(address, case):
    sent, expected = TAKEN[case]
    statuses, said = answers(address, sent + NEXT)
    assert statuses == [expected, 200]
    assert said.count(b"queue_seconds") == 1 + (expected == 200)


@pytest.mark.parametrize("ranges", [b"0-0", b"-1", b"9-3", b",".join([b"0-"] * 3000)])
def test_a_part_of_an_answer_is_the_whole_of_it(address, ranges):
    head = b"Host: localhost\r\nConnection: close\r\nRange: bytes=" + ranges + b"\r\n"
    whole = answers(address, get(b"Host: localhost\r\nConnection: close\r\n", b"/"))
    part = answers(address, get(head + b'If-Range: "x"\r\n', b"/"))
    assert part[0] == [200]
    assert part[1].partition(b"\r\n\r\n")[2] == whole[1].partition(b"\r\n\r\n")[2]
