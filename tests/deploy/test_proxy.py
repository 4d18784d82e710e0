"""The proxy of deploy/: its own configuration, run on loopback in front of a service."""

import http.client
import json
import logging
import re
import socket
import threading
from contextlib import ExitStack, closing, suppress

import pytest

from tests.support.live import GLB, received, request_head, served
from tests.support.proxy import free_port, proxied


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


@pytest.fixture
def address(proxy):
    return proxy[0]


def ask(address, method, path, body=None, headers=None):
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer, answer.read()


def said_to(address, sent):
    """All that is answered to some bytes, until the connection ends."""
    with socket.create_connection(address, timeout=600) as connection:
        connection.sendall(sent)
        return received(connection)


def heard(address, lines):
    """The service's lines of all that was asked before; they are written once answers are sent."""
    ask(address, "GET", "/limits")
    pause = threading.Event()
    while "/limits" not in [line["route"] for line in list(lines)]:
        pause.wait(0.01)
    return list(lines)


def test_requests_go_through_as_the_client_s_and_not_as_it_claims(proxy):
    address, lines, _ = proxy
    answer, body = ask(address, "POST", "/subdivide", b"echo", GLB)
    assert (answer.status, body) == (200, b"echo")
    claims = {"X-Forwarded-For": "203.0.113.9", "X-Request-ID": "mine-1"}
    answer, _ = ask(address, "GET", "/healthz", headers=claims)
    assert answer.headers["x-request-id"] == "mine-1"
    # The only address that the proxy sees is that of this machine, which is the proxy's own here.
    assert {line["client"] for line in heard(address, lines)} == {"127.0.0.1"}
    # What is no token is replaced.
    answer, _ = ask(address, "GET", "/healthz", headers={"X-Request-ID": 'a" b'})
    assert re.fullmatch("[0-9a-f]{32}", answer.headers["x-request-id"])
    # A request of HTTP/1.0 may name no host.
    assert said_to(address, b"GET /healthz HTTP/1.0\r\n\r\n").startswith(b"HTTP/1.1 200 ")


def test_a_body_over_the_limit_ends_at_the_proxy(proxy):
    address, lines, _ = proxy
    del lines[:]
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.putrequest("POST", "/subdivide")
        connection.putheader("Content-Length", str(65 * 2**20))
        connection.endheaders()
        answer = connection.getresponse()
        # As the service would say it.
        assert answer.headers["content-type"] == "application/problem+json"
        problem = json.loads(answer.read())
    assert (answer.status, problem["status"], problem["code"]) == (413, 413, "limit-exceeded")
    assert "/subdivide" not in [line["route"] for line in heard(address, lines)]


@pytest.mark.parametrize(
    "sent",
    [
        b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-",
        request_head("Content-Length: 100") + b"half",
    ],
    ids=["a slow head", "a body that stops"],
)
def test_what_does_not_end_is_the_proxys_to_end_and_the_service_never_hears_of_it(proxy, sent):
    address, lines, _ = proxy
    del lines[:]
    assert b"200 OK" not in said_to(address, sent)
    assert lines == []


def test_half_a_body_never_reaches_the_service(proxy):
    address, lines, _ = proxy
    del lines[:]
    with socket.create_connection(address, timeout=600) as sender:
        head = request_head("Content-Length: 2000000", target="POST /report")
        sender.sendall(head + bytes(10**6))
    assert "/report" not in [line["route"] for line in heard(address, lines)]


def test_a_body_in_countless_pieces_comes_to_the_service_in_one(address):
    """Its parser of HTTP would be busy with them for seconds."""
    head = request_head("Connection: close", "Transfer-Encoding: chunked")
    said = said_to(address, head + b"1\r\nx\r\n" * 50_000 + b"0\r\n\r\n")
    assert said.endswith(b"x" * 50_000)


@pytest.mark.parametrize(
    ("query", "kind", "status"),
    [
        *((query, "model/gltf-binary", 422) for query in ("levels=9", "model=none")),
        ("levels=1", "none/none", 415),
    ],
)
def test_an_answer_before_the_body_is_whole_reaches_its_client(address, query, kind, status):
    body, headers = bytes(2**24), {"Content-Type": kind}
    answer, text = ask(address, "POST", f"/subdivide?{query}", body, headers)
    assert (answer.status, json.loads(text)["status"]) == (status, status)


def test_a_stream_passes_as_it_comes(address, tmp_path):
    headers = GLB | {"Accept": "multipart/mixed"}
    with closing(http.client.HTTPConnection(*address, timeout=600)) as connection:
        connection.request("POST", "/subdivide", f"steps {tmp_path}", headers)
        answer = connection.getresponse()
        assert "X-Accel-Buffering" not in answer.headers
        said = b""
        for number in (1, 2, 3):
            while b'"share":%.2f' % (number / 4) not in said.replace(b"0.5}", b"0.50}"):
                said += answer.read1()
            (tmp_path / f"go-{number}").touch()
        assert answer.read().endswith(b"--\r\n")


# How much one address may have


def beginning(connection):
    with suppress(ConnectionResetError):
        return connection.recv(4096)
    return b""


def answers(address, clients):
    """How answers begin to uploads of clients that are all open at once, the last one first."""
    with ExitStack() as stack:
        held = []
        for client in clients:
            connection = socket.create_connection(address, timeout=600)
            held.append(stack.enter_context(connection))
            connection.sendall(request_head(f"X-Client: {client}", "Content-Length: 100"))
        return [beginning(connection) for connection in reversed(held)]


@pytest.mark.parametrize("client", ["192.0.2.9", "2001:db8:0:1::{:x}"])
def test_one_address_has_so_many_connections_and_no_more(address, client):
    """One subscriber has as many addresses of IPv6 as it likes."""
    said = answers(address, [client.format(host) for host in range(40)])
    refused, *_ = (answer for answer in said if answer.startswith(b"HTTP/1.1 429"))
    assert json.loads(refused.partition(b"\r\n\r\n")[2])["code"] == "too-many-requests"
    answer, _ = ask(address, "GET", "/limits", headers={"X-Client": "2001:db8:0:2::1"})
    assert answer.status == 200


# Services that are gone, and what is logged


def test_without_a_service_the_proxy_says_so(tmp_path):
    with proxied(("127.0.0.1", free_port()), tmp_path) as address:
        answer, text = ask(address, "GET", "/limits", headers={"X-Request-ID": "mine"})
    assert (answer.status, answer.headers["content-type"]) == (502, "application/problem+json")
    assert int(answer.headers["retry-after"]) >= 1
    said = {"status": 502, "code": "no-service", "request_id": "mine"}
    assert said.items() <= json.loads(text).items()


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


def test_the_proxys_logs_say_nothing_of_paths(proxy):
    address, _, folder = proxy
    ask(address, "GET", "/nothing?secret=1")
    refused, _ = ask(address, "POST", "/nothing?secret=1", headers={"Content-Length": str(2**27)})
    assert refused.status == 413
    log = (folder / "access.log").read_text()
    assert all(json.loads(line)["status"] for line in log.splitlines())
    for said in (log, (folder / "error.log").read_text()):
        assert "secret" not in said
        assert "nothing" not in said
