"""Attacks, each from loopback addresses of its own, until it is told to end."""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.synchronize import Event

from tests.soak.target import PATIENCE, Target, head, hold_anew, side_by_side

CHUNKED = "Transfer-Encoding: chunked\r\n"
Attack = Callable[[Target, Event], None]


def crumbs(target: Target, ended: Event) -> None:
    """Four connections of one-byte chunks, again and again."""

    def connect(number: int) -> None:
        flood = head("POST", "/subdivide", CHUNKED) + b"1\r\nx\r\n" * 10_000
        while not ended.is_set():
            with suppress(OSError), target.connected(number) as opened:
                opened.sendall(flood)
                while opened.recv(2**16):
                    pass

    side_by_side(connect, 4)


def trickles(target: Target, ended: Event) -> None:
    """Uploads of a byte a second: as many as may arrive at the same time, and more."""
    hold_anew(target, ended, 96, head("POST", "/subdivide", "Content-Length: 1000000\r\n"), b"x")


def slow_heads(target: Target, ended: Event) -> None:
    """Heads that never end."""
    hold_anew(target, ended, 200, b"GET /healthz HTTP/1.1\r\nX-A: ", b"x")


def idle(target: Target, ended: Event) -> None:
    """More connections than there are slots for, that say nothing."""
    hold_anew(target, ended, 700, b"", b"")


def unread(target: Target, ended: Event) -> None:
    """Bodies without end for routes that read none."""

    def connect(number: int) -> None:
        path = ("/healthz", "/nothing", "/subdivide?levels=9", "/models")[number % 4]
        chunk = b"10000\r\n" + bytes(2**16) + b"\r\n"
        while not ended.is_set():
            with suppress(OSError), target.connected(number) as opened:
                opened.sendall(head("POST", path, CHUNKED))
                while not ended.is_set():
                    opened.sendall(chunk)
            ended.wait(0.5)

    side_by_side(connect, 4)


def slow_readers(target: Target, ended: Event) -> None:
    """Ask for large answers and take a few bytes of each."""
    requests = head("GET", "/docs/swagger-ui-bundle.js") * 8

    def connect(number: int) -> None:
        while not ended.is_set():
            with suppress(OSError), target.connected(number) as opened:
                opened.sendall(requests)
                while not ended.is_set() and opened.recv(64):
                    ended.wait(1)

    side_by_side(connect, 24)


def pipelines(target: Target, ended: Event) -> None:
    """Hundreds of requests on a connection before the first answer; half of them are never read."""
    asked = [head("GET", path) for path in ("/healthz", "/limits", "/nothing", "/docs")]
    requests = b"".join(itertools.islice(itertools.cycle(asked), 600))

    def connect(number: int) -> None:
        while not ended.wait(0.2):
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(2)
                opened.sendall(requests)
                while number % 2 and opened.recv(2**16):
                    pass

    side_by_side(connect, 4)


def nonsense(target: Target, ended: Event) -> None:
    """Send bytes that are no HTTP, or nearly."""
    messages = [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(64),
        b"GET / HTTP/9.9\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 5000,
        head("POST", "/subdivide", CHUNKED) + b"zz\r\n",
        b"GET /\x1b[31m HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: 1.1.1.1\r\n\r\n",
        b"GET /" + b"a" * 2**17,
        head("POST", "/assets/../../etc/passwd"),
    ]

    def connect(number: int) -> None:
        for message in itertools.islice(itertools.cycle(messages), number, None):
            if ended.wait(0.02):
                return
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(2)
                opened.sendall(message)
                opened.recv(2**16)

    side_by_side(connect, 4)


def bombs(target: Target, ended: Event) -> None:
    """Small files that ask for much: empty chunks, many nodes, deep levels, a zip of zeros."""
    files = [_empty_chunks(300_000), _many_nodes(100_000), b"PK\x03\x04" + bytes(10_000)]

    def connect(number: int) -> None:
        for body in itertools.islice(itertools.cycle(files), number, None):
            if ended.wait(0.2):
                return
            asks = head("POST", "/subdivide?levels=6", f"Content-Length: {len(body)}\r\n")
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(PATIENCE)
                opened.sendall(asks + body)
                opened.recv(2**16)

    side_by_side(connect, 2)


def _empty_chunks(count: int) -> bytes:
    text = b'{"asset":{"version":"2.0"}} '
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", 0, b"abcd") * count
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _many_nodes(count: int) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, "nodes": [{}] * count}).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<I4s", len(text), b"JSON") + text
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk


def whiskers(target: Target, ended: Event) -> None:
    """Polygons with a whisker of 16,000 corners and no width, which take long to cut badly."""
    count = 8_000
    there = [(8 + n, 0) for n in range(count)]
    outline = [(0, 0), (4, 1), (8, 0), *there, *reversed(there), (8, 8), (0, 8)]
    text = "".join(f"v {x} {y} 0\n" for x, y in outline)
    body = (text + "f " + " ".join(map(str, range(1, len(outline) + 1)))).encode()

    def connect(number: int) -> None:
        asks = head("POST", "/subdivide?polygons=off", f"Content-Length: {len(body)}\r\n")
        asks = asks.replace(b"model/gltf-binary", b"model/obj")
        while not ended.wait(0.1):
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(PATIENCE)
                opened.sendall(asks + body)
                opened.recv(2**16)

    side_by_side(connect, 6)


def left_streams(target: Target, ended: Event) -> None:
    """Streams that are left once they have begun, and others of which nothing is read."""
    body = _deep()

    def connect(number: int) -> None:
        more = f"Accept: multipart/mixed\r\nContent-Length: {len(body)}\r\n"
        while not ended.is_set():
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(PATIENCE)
                opened.sendall(head("POST", "/subdivide?levels=5", more) + body)
                opened.recv(256)
                ended.wait(0.2 if number % 2 else 15)

    side_by_side(connect, 12)


def _deep() -> bytes:
    from service.meshfiles.example import part_glb

    return part_glb()


ATTACKS: dict[str, Attack] = {
    "one-byte chunks": crumbs,
    "trickling uploads": trickles,
    "endless heads": slow_heads,
    "idle connections": idle,
    "unread bodies": unread,
    "slow readers": slow_readers,
    "pipelines": pipelines,
    "nonsense": nonsense,
    "bombs": bombs,
    "whiskers": whiskers,
    "streams that are left": left_streams,
}
