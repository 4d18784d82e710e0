"""The proxy of deploy/: its own configuration, run on loopback in front of a service."""

import http.client
import json
import logging
import re
import socket
import threading
from contextlib import ExitStack, closing, suppress

import pytest

from tests.support.live import served
from tests.support.proxy import free_port, proxied

GLB = {"Content-Type": "model/gltf-binary"}


@pytest.fixture(scope="module")
def proxy(tmp_path_factory):
    """The address of a proxy, the service's log of requests, and the proxy's folder."""
    folder = tmp_path_factory.mktemp("proxy")
    lines = []
    handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.fields | {"request_id": record.request_id})
    journal = logging.getLogger("pns.request")
    level = journal.level
    journal.addHandler(handler)
    journal.setLevel(logging.INFO)
    try:
        with served(workers=1, proxies="127.0.0.1") as behind, proxied(behind, folder) as address:
            yield address, lines, folder
    finally:
        journal.removeHandler(handler)
        journal.setLevel(level)


def ask(address, method, path, body=None, headers=None):
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer, answer.read()


def test_requests_go_through(proxy):
    answer, body = ask(proxy[0], "POST", "/subdivide", b"echo", GLB)
    assert (answer.status, body) == (200, b"echo")


def test_the_service_sees_the_client_and_not_what_it_claims(proxy):
    address, lines, _ = proxy
    del lines[:]
    claims = {"X-Forwarded-For": "203.0.113.9", "X-Request-ID": "mine-1"}
    answer, _ = ask(address, "GET", "/healthz", headers=claims)
    assert answer.headers["x-request-id"] == "mine-1"
    # Its line is written once the answer is sent.
    pause = threading.Event()
    while not lines:
        pause.wait(0.01)
    # The only address that the proxy sees is that of this machine, which is the proxy's own here.
    assert {line["client"] for line in lines} == {"127.0.0.1"}


def test_a_request_id_that_is_no_token_is_replaced(proxy):
    answer, _ = ask(proxy[0], "GET", "/healthz", headers={"X-Request-ID": 'a" b'})
    assert re.fullmatch("[0-9a-f]{32}", answer.headers["x-request-id"])


def heard(address, lines):
    """The service's lines of all that was asked before; they are written once answers are sent."""
    ask(address, "GET", "/limits")
    pause = threading.Event()
    while "/limits" not in [line["route"] for line in list(lines)]:
        pause.wait(0.01)
    return list(lines)


def test_a_body_over_the_limit_ends_at_the_proxy(proxy):
    address, lines, _ = proxy
    del lines[:]
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.putrequest("POST", "/subdivide")
        connection.putheader("Content-Length", str(65 * 2**20))
        connection.endheaders()
        answer = connection.getresponse()
        assert answer.status == 413
        # As the service would say it.
        assert answer.headers["content-type"] == "application/problem+json"
        problem = json.loads(answer.read())
        assert (problem["status"], problem["code"]) == (413, "limit-exceeded")
    told = [line["route"] for line in heard(address, lines)]
    assert "/subdivide" not in told


def test_a_slow_head_is_the_proxys_to_end_and_the_service_never_hears_of_it(proxy):
    address, lines, _ = proxy
    del lines[:]
    with socket.create_connection(address, timeout=600) as connection:
        connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-")
        pieces = iter(lambda: connection.recv(4096), b"")
        with suppress(ConnectionResetError):
            assert b"200 OK" not in b"".join(pieces)
    assert lines == []


def test_a_body_that_stops_is_the_proxys_to_end(proxy):
    with socket.create_connection(proxy[0], timeout=600) as connection:
        connection.sendall(
            b"POST /subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/gltf-binary\r\n"
            b"Content-Length: 100\r\n\r\nhalf"
        )
        with suppress(ConnectionResetError):
            assert b"200 OK" not in b"".join(iter(lambda: connection.recv(4096), b""))


@pytest.mark.parametrize("query", ["levels=9", "model=none", "levels=1"])
def test_an_answer_before_the_body_is_whole_reaches_its_client(proxy, query):
    kind = "none/none" if query == "levels=1" else "model/gltf-binary"
    answer, text = ask(
        proxy[0], "POST", f"/subdivide?{query}", bytes(2**24), {"Content-Type": kind}
    )
    assert answer.status == (415 if kind == "none/none" else 422)
    assert json.loads(text)["status"] == answer.status


def beginning(connection, size):
    try:
        return connection.recv(4096)[:size]
    except ConnectionResetError:
        return b""


def answers(address, requests, size=12):
    """Return how answers begin to requests that are all open at once, the last one first."""
    with ExitStack() as stack:
        held = [
            stack.enter_context(socket.create_connection(address, timeout=600)) for _ in requests
        ]
        for connection, request in zip(held, requests, strict=True):
            connection.sendall(request.encode())
        return [beginning(connection, size) for connection in reversed(held)]


def test_one_address_has_so_many_connections_and_no_more(proxy):
    address, _, _ = proxy
    upload = "POST /subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n"
    said = answers(address, [upload] * 40, size=4096)
    (refused, *_) = (answer for answer in said if answer.startswith(b"HTTP/1.1 429"))
    assert json.loads(refused.partition(b"\r\n\r\n")[2])["code"] == "too-many-requests"


def test_a_subscribers_ipv6_addresses_are_one(proxy):
    """One subscriber has as many addresses as it likes."""
    address, _, _ = proxy
    upload = (
        "POST /subdivide HTTP/1.1\r\nHost: localhost\r\nX-Client: {}\r\nContent-Length: 100\r\n\r\n"
    )
    clients = [f"2001:db8:0:1::{host:x}" for host in range(40)]
    assert b"HTTP/1.1 429" in answers(address, [upload.format(client) for client in clients])
    answer, _ = ask(address, "GET", "/limits", headers={"X-Client": "2001:db8:0:2::1"})
    assert answer.status == 200


def test_without_a_service_the_proxy_says_so(tmp_path):
    with proxied(("127.0.0.1", free_port()), tmp_path) as address:
        answer, text = ask(address, "GET", "/limits", headers={"X-Request-ID": "mine"})
    assert (answer.status, answer.headers["content-type"]) == (502, "application/problem+json")
    assert int(answer.headers["retry-after"]) >= 1
    problem = json.loads(text)
    assert (problem["status"], problem["code"]) == (502, "no-service")
    assert problem["request_id"] == "mine"


def test_the_proxys_logs_say_nothing_of_paths(proxy):
    """A job's id is all that its result takes."""
    address, _, folder = proxy
    ask(address, "GET", "/nothing?secret=1")
    refused, _ = ask(address, "POST", "/nothing?secret=1", headers={"Content-Length": str(2**27)})
    assert refused.status == 413
    log = (folder / "access.log").read_text()
    assert all(json.loads(line)["status"] for line in log.splitlines())
    for said in (log, (folder / "error.log").read_text()):
        assert "secret" not in said
        assert "nothing" not in said


def test_a_request_of_http_1_0_may_name_no_host(proxy):
    with socket.create_connection(proxy[0], timeout=600) as connection:
        connection.sendall(b"GET /healthz HTTP/1.0\r\n\r\n")
        said = b"".join(iter(lambda: connection.recv(4096), b""))
    assert said.startswith(b"HTTP/1.1 200 ")


def test_a_body_in_countless_pieces_comes_to_the_service_in_one(proxy):
    """Its parser of HTTP would be busy with them for seconds."""
    with socket.create_connection(proxy[0], timeout=600) as connection:
        connection.sendall(
            b"POST /subdivide HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/gltf-binary\r\n"
            b"Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n"
            + b"1\r\nx\r\n" * 50_000
            + b"0\r\n\r\n"
        )
        said = b"".join(iter(lambda: connection.recv(2**16), b""))
    assert said.endswith(b"x" * 50_000)


def test_half_a_body_never_reaches_the_service(proxy):
    address, lines, _ = proxy
    del lines[:]
    with socket.create_connection(address, timeout=600) as sender:
        sender.sendall(
            b"POST /report HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/gltf-binary\r\n"
            b"Content-Length: 2000000\r\n\r\n" + bytes(10**6)
        )
    assert "/report" not in [line["route"] for line in heard(address, lines)]


def test_a_stream_passes_as_it_comes(proxy, tmp_path):
    headers = GLB | {"Accept": "multipart/mixed"}
    with closing(http.client.HTTPConnection(*proxy[0], timeout=600)) as connection:
        connection.request("POST", "/subdivide", f"steps {tmp_path}", headers)
        answer = connection.getresponse()
        assert "X-Accel-Buffering" not in answer.headers
        said = b""
        for number in (1, 2, 3):
            while b'"share":%.2f' % (number / 4) not in said.replace(b"0.5}", b"0.50}"):
                said += answer.read1()
            (tmp_path / f"go-{number}").touch()
        assert answer.read().endswith(b"--\r\n")


def test_where_a_replica_dies_the_other_serves(tmp_path):
    with (
        served(workers=1, proxies="127.0.0.1") as first,
        ExitStack() as second,
        proxied(first, tmp_path, second.enter_context(served(workers=1))) as address,
    ):
        assert ask(address, "POST", "/subdivide", b"echo", GLB)[0].status == 200
        second.close()
        for _ in range(6):
            assert ask(address, "POST", "/subdivide", b"echo", GLB)[0].status == 200
