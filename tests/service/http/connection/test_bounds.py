"""A connection takes bounded bytes, pieces and time, whatever is asked on it; over real sockets.

Nothing here measures time: a test waits for the server's answer or its end, and each socket gives
up after `PATIENCE` where neither comes.
"""

import gc
import http.client
import itertools
import json
import re
import socket
import time
from contextlib import ExitStack, closing

import pytest

from service.http.connection import protocol
from service.http.connection.parser import FREE_PIECES
from service.http.connection.shared import READ_BYTES
from tests.support.live import served

PATIENCE = 30
MIB = 2**20
HEAD = "{} {} HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/gltf-binary\r\n{}\r\n"
CHUNKED = "Transfer-Encoding: chunked\r\n"


@pytest.fixture(scope="module")
def address():
    """A server with the usual times, and small bodies."""
    with served(workers=1, body=MIB) as where:
        yield where


@pytest.fixture(scope="module")
def hasty():
    """A server that waits for nobody."""
    hurry = {"head_seconds": 0.5, "keep_alive_seconds": 0.5, "linger_seconds": 0.5}
    with served(workers=1, rate=64 * MIB, grace_seconds=0.5, **hurry) as where:
        yield where


def connect(address, *, source=None):
    return socket.create_connection(address, timeout=PATIENCE, source_address=source)


def head(method, path, more=""):
    return HEAD.format(method, path, more).encode()


def received(connection):
    """All that the server sends before it ends the connection."""
    pieces = []
    try:
        while piece := connection.recv(2**16):
            pieces.append(piece)
    except ConnectionResetError:
        pass
    return b"".join(pieces)


def status(answer):
    return int(answer.split(maxsplit=2)[1])


def problem(answer):
    return json.loads(answer.partition(b"\r\n\r\n")[2])


def protocol_of(connection):
    """The server's side of a connection."""
    # By type: some objects warn where they are asked for their class.
    (mine,) = (
        known
        for known in gc.get_objects()
        if issubclass(type(known), protocol.BoundedProtocol)
        and known.client == connection.getsockname()
    )
    return mine


def until_it_runs(folder):
    """Wait until a worker has taken the job that tells its steps in a folder."""
    while not (folder / "took-1").exists():
        time.sleep(0.005)


def trickle(connection, piece=b"x", *, most=PATIENCE / 0.05):
    """Send a piece now and then, until the server ends the connection; return what it said."""
    connection.settimeout(0.05)
    said = b""
    for _ in range(int(most)):
        try:
            connection.sendall(piece)
            if not (got := connection.recv(2**16)):
                return said
            said += got
        except TimeoutError:
            continue
        except OSError:
            return said
    pytest.fail("the connection does not end")


UNREAD = [("GET", "/healthz", 200), ("POST", "/nothing", 404), ("POST", "/subdivide?levels=9", 422)]


@pytest.mark.parametrize(("method", "path", "expected"), UNREAD)
def test_a_body_that_no_route_reads_is_not_taken_without_end(address, method, path, expected):
    chunk = b"10000\r\n" + bytes(2**16) + b"\r\n"
    sent = 0
    with connect(address) as connection:
        connection.sendall(head(method, path, CHUNKED))
        try:
            for _ in range(16 * 64):
                connection.sendall(chunk)
                sent += len(chunk)
        except OSError:
            pass
    # Twice the limit is listened to; the sockets' buffers hold some more.
    assert sent <= 32 * MIB


@pytest.mark.parametrize(("method", "path", "expected"), UNREAD)
def test_a_body_that_no_route_reads_may_not_trickle(hasty, method, path, expected):
    with connect(hasty) as connection:
        connection.sendall(head(method, path, CHUNKED))
        answer = trickle(connection, b"1\r\nx\r\n")
    assert status(answer) == expected
    assert b"\r\nconnection: close\r\n" in answer.lower()


@pytest.mark.parametrize("size", [MIB + 1, 2 * MIB, 3 * MIB])
def test_a_client_that_sends_first_and_reads_later_sees_its_413(address, size):
    for _ in range(8):
        with closing(http.client.HTTPConnection(*address, timeout=PATIENCE)) as connection:
            connection.request("POST", "/subdivide", bytes(size))
            answer = connection.getresponse()
            assert answer.status == 413
            assert json.loads(answer.read())["limit"] == "body"
            assert answer.headers["connection"] == "close"


def test_a_connection_whose_bodies_are_whole_is_kept(address):
    with connect(address) as connection:
        for _ in range(3):
            # In one piece: where the body comes later than the answer, the connection ends.
            connection.sendall(head("POST", "/nothing", "Content-Length: 5\r\n") + b"hello")
            with http.client.HTTPResponse(connection) as answer:
                answer.begin()
                assert (answer.status, answer.headers["connection"]) == (404, None)
                answer.read()


def test_413_for_a_body_in_countless_pieces(address):
    with connect(address) as connection:
        connection.sendall(head("POST", "/subdivide", CHUNKED) + b"1\r\nx\r\n" * (4 * FREE_PIECES))
        answer = received(connection)
    assert status(answer) == 413
    assert problem(answer)["limit"] == "pieces"


def test_a_chunked_body_in_ordinary_pieces_is_taken(address):
    pieces = [bytes([n]) * 1024 for n in range(250)]
    with closing(http.client.HTTPConnection(*address, timeout=PATIENCE)) as connection:
        headers = {"Content-Type": "model/gltf-binary"}
        connection.request("POST", "/subdivide", iter(pieces), headers, encode_chunked=True)
        answer = connection.getresponse()
        assert answer.status == 200
        assert answer.read() == b"".join(pieces)


def test_many_small_chunks_within_the_limit_are_taken_whole(address):
    body = bytes(itertools.islice(itertools.cycle(b"abc"), FREE_PIECES))
    with connect(address) as connection:
        chunks = b"".join(b"1\r\n%c\r\n" % byte for byte in body)
        connection.sendall(head("POST", "/subdivide", CHUNKED) + chunks + b"0\r\n\r\n")
        assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")


def test_408_for_a_head_that_trickles(hasty):
    with connect(hasty) as connection:
        connection.sendall(b"GET /healthz HTTP/1.1\r\nX-")
        answer = trickle(connection)
    assert (status(answer), problem(answer)["code"]) == (408, "head-timeout")


def test_a_connection_that_says_nothing_is_ended(hasty):
    with connect(hasty) as connection:
        assert received(connection) == b""


def test_a_second_head_may_not_trickle_either(hasty):
    with connect(hasty) as connection:
        connection.sendall(head("GET", "/healthz"))
        assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")
        connection.sendall(b"GET /healthz HTTP/1.1\r\nX-")
        answer = trickle(connection)
    assert (status(answer), problem(answer)["code"]) == (408, "head-timeout")


def test_a_second_head_may_not_trickle_behind_the_first(hasty):
    with connect(hasty) as connection:
        connection.sendall(head("GET", "/healthz") + b"GET /healthz HTTP/1.1\r\nX-")
        answer = trickle(connection)
    first, _, second = answer.partition(b'{"status":"ok"}')
    assert (status(first), status(second)) == (200, 408)


def test_408_for_an_upload_below_the_least_rate(hasty):
    with connect(hasty) as connection:
        connection.sendall(head("POST", "/subdivide", f"Content-Length: {2**20}\r\n"))
        answer = trickle(connection, bytes(100))
    assert status(answer) == 408
    assert "slower than" in problem(answer)["detail"]


def test_a_reader_below_the_least_rate_is_cut_off(hasty):
    body = f"large {48 * MIB}".encode().ljust(100)
    taken = 0
    with connect(hasty) as connection:
        connection.sendall(head("POST", "/subdivide", f"Content-Length: {len(body)}\r\n") + body)
        connection.recv(1)
        try:
            # Never idle: it takes a little all the time.
            while piece := connection.recv(2**14):
                taken += len(piece)
                time.sleep(0.02)
        except ConnectionResetError:
            pass
    assert taken < 48 * MIB


def test_of_an_answer_that_is_not_read_neither_server_nor_system_holds_much(address):
    """A file of the page's size, whole in the server's memory once, whoever else asks for it."""
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(PATIENCE)
        connection.connect(address)
        connection.sendall(head("GET", "/docs/swagger-ui-bundle.js"))
        assert connection.recv(12) == b"HTTP/1.1 200"
        mine = protocol_of(connection)
        while not (mine.flow.write_paused or mine.cycle.response_complete):
            time.sleep(0.005)
        assert mine.flow.write_paused
        assert mine.transport.get_write_buffer_size() <= 2**18
        assert mine.transport.taken <= 2**19


@pytest.mark.parametrize(
    ("sent", "expected", "detail"),
    [
        (b"secret\r\n\r\n", 400, "illegal request line"),
        (b"GET / HTTP/1.1\r\n\r\n", 400, "Missing mandatory Host: header"),
        (b"GET / HTTP/1.1\r\nKey : secret\r\n\r\n", 400, "illegal header line"),
        (b"GET / HTTP/1.1\r\nHost: a\nX: secret\r\n\r\n", 400, "lines end with CR and LF"),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 2**17, 431, "too long"),
        (
            b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: gzip\r\n\r\n",
            501,
            "Only .*chunked",
        ),
    ],
)
def test_what_is_no_http_is_answered_with_a_problem_and_written_down(
    address, sent, expected, detail, caplog
):
    with connect(address) as connection:
        connection.sendall(sent)
        answer = received(connection)
    assert status(answer) == expected
    assert problem(answer)["status"] == expected
    assert re.search(detail, problem(answer)["detail"])
    # What it could not read may have been a key.
    assert "secret" not in caplog.text
    (line,) = [record for record in caplog.records if record.name == "pns.connection"]
    assert line.fields == {"status": expected, "code": "invalid-http", "client": "127.0.0.1"}


def test_a_body_that_stops_being_http_is_a_problem_too(address):
    with connect(address) as connection:
        connection.sendall(head("POST", "/subdivide", CHUNKED) + b"1\r\nx\r\nnonsense\r\n")
        answer = received(connection)
    assert (status(answer), problem(answer)["code"]) == (400, "invalid-http")


def test_an_address_that_has_its_share_is_refused_and_others_are_not(caplog):
    with served(workers=1, connections_of_address=3) as where, ExitStack() as opened:
        for _ in range(3):
            connection = opened.enter_context(connect(where))
            connection.sendall(head("GET", "/healthz"))
            assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")
        answer = received(opened.enter_context(connect(where)))
        assert (status(answer), problem(answer)["code"]) == (503, "too-many-connections")
        assert caplog.records[-1].fields["client"] == "127.0.0.1"
        other = opened.enter_context(connect(where, source=("127.0.0.2", 0)))
        other.sendall(head("GET", "/healthz"))
        assert other.recv(2**16).startswith(b"HTTP/1.1 200 ")


def test_a_named_proxy_has_no_share():
    with (
        served(workers=1, connections_of_address=1, proxies="127.0.0.1") as where,
        ExitStack() as opened,
    ):
        for _ in range(5):
            connection = opened.enter_context(connect(where))
            connection.sendall(head("GET", "/healthz"))
            assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")


def test_idle_connections_give_way_to_those_that_ask():
    with served(workers=1, connections=8, head_seconds=60) as where, ExitStack() as opened:
        idle = [opened.enter_context(connect(where)) for _ in range(30)]
        for connection in idle[:4]:
            # Some have begun to ask, and do not go on. The first are closed already.
            try:
                connection.sendall(b"GET ")
            except OSError:
                continue
        late = opened.enter_context(connect(where))
        late.sendall(head("GET", "/healthz"))
        assert late.recv(2**16).startswith(b"HTTP/1.1 200 ")
        assert received(idle[10]) == b""


def test_a_client_that_only_sends_and_never_reads_is_let_go(hasty):
    """More answers than the sockets hold: the connection ends, and the server serves others."""
    with connect(hasty) as connection:
        requests = head("GET", "/openapi.json") * 64
        try:
            while True:
                connection.sendall(requests)
        except OSError:
            pass
    with connect(hasty) as connection:
        connection.sendall(head("GET", "/healthz"))
        assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")


def test_requests_that_wait_behind_another_stay_in_the_clients_socket(address, tmp_path):
    """Two reads of them at most are the server's, however many are sent before the first answer."""
    body = f"steps {tmp_path}".encode()
    with connect(address) as connection:
        connection.sendall(head("POST", "/subdivide", f"Content-Length: {len(body)}\r\n") + body)
        until_it_runs(tmp_path)
        mine = protocol_of(connection)
        connection.setblocking(False)
        requests = head("GET", "/healthz") * 1000
        while mine.transport.is_reading():
            try:
                connection.send(requests)
            except BlockingIOError:
                time.sleep(0.005)
        assert 0 < len(mine.conn.trailing_data[0]) <= 2 * READ_BYTES
        for number in (1, 2, 3):
            (tmp_path / f"go-{number}").touch()
        connection.settimeout(PATIENCE)
        assert connection.recv(2**16).startswith(b"HTTP/1.1 200 ")


def served_late(where, opened):
    """The first answer of a connection that found a place, where others came before it."""
    for _ in range(PATIENCE * 20):
        late = opened.enter_context(connect(where))
        late.sendall(head("GET", "/healthz", "Connection: close\r\n"))
        answer = received(late)
        # Too early to tell which is the slowest.
        if not answer.startswith(b"HTTP/1.1 503 "):
            return answer
        time.sleep(0.05)
    pytest.fail("nobody gives way")


def test_trickling_uploads_give_way_to_those_that_ask(monkeypatch):
    monkeypatch.setattr(protocol, "RATE_SECONDS", 0.2)
    with served(workers=1, connections=4) as where, ExitStack() as opened:
        begun = head("POST", "/subdivide", "Content-Length: 1000\r\n")
        trickling = [opened.enter_context(connect(where)) for _ in range(4)]
        for connection in trickling:
            connection.sendall(begun)
        assert served_late(where, opened).startswith(b"HTTP/1.1 200 ")


def test_slow_readers_give_way_to_those_that_ask(monkeypatch):
    monkeypatch.setattr(protocol, "RATE_SECONDS", 0.2)
    body = f"large {16 * MIB}".encode()
    asks = head("POST", "/subdivide", f"Content-Length: {len(body)}\r\n") + body
    with served(workers=1, connections=4) as where, ExitStack() as opened:
        for _ in range(4):
            reader = opened.enter_context(connect(where))
            reader.sendall(asks)
            assert reader.recv(12) == b"HTTP/1.1 200"
        assert served_late(where, opened).startswith(b"HTTP/1.1 200 ")


def test_streams_of_events_give_way_as_if_they_had_ended(tmp_path):
    """Whoever follows a job asks again; the job goes on."""
    with served(workers=1, connections=4) as where, ExitStack() as opened:
        client = opened.enter_context(closing(http.client.HTTPConnection(*where, PATIENCE)))
        kind = {"Content-Type": "model/gltf-binary"}
        client.request("POST", "/jobs", f"steps {tmp_path}", kind)
        job = json.loads(client.getresponse().read())["id"]
        until_it_runs(tmp_path)
        followers = [client.sock, *(opened.enter_context(connect(where)) for _ in range(3))]
        for connection in followers:
            connection.sendall(head("GET", f"/jobs/{job}/events"))
            assert connection.recv(12) == b"HTTP/1.1 200"
        assert served_late(where, opened).startswith(b"HTTP/1.1 200 ")
        assert received(followers[0]).endswith(b"0\r\n\r\n")
        asks = opened.enter_context(connect(where))
        asks.sendall(head("GET", f"/jobs/{job}", "Connection: close\r\n"))
        assert problem(received(asks))["state"] == "running"
