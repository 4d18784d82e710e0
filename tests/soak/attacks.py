"""Attacks, each from loopback addresses of its own, until it is told to end."""

from __future__ import annotations

import itertools
import json
import socket
import struct
import threading
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.synchronize import Event

from service.meshfiles.example import part_glb

PATIENCE = 30
HEAD = "{} {} HTTP/1.1\r\nHost: localhost\r\nContent-Type: {}\r\n{}\r\n"
CHUNKED = "Transfer-Encoding: chunked\r\n"


def head(method, path, more="", kind="model/gltf-binary"):
    """A request's head; `more` are whole lines of it."""
    return HEAD.format(method, path, kind, more).encode()


def whole(path, body, more="", kind="model/gltf-binary"):
    """A request with its body."""
    return head("POST", path, f"{more}Content-Length: {len(body)}\r\n", kind) + body


@dataclass(frozen=True)
class Target:
    """The address under attack, and its sources: this machine's many, or (`one_source`) one.

    A container's bridge carries no loopback address but the one that it listens on. `struck` is set
    by the first connection of an attack.
    """

    address: tuple[str, int]
    one_source: bool
    struck: Event

    @contextmanager
    def connected(self, number):
        """A connection from one of the attackers' addresses, none of them an honest client's."""
        source = None if self.one_source else (f"127.9.{number // 16}.{1 + number % 16}", 0)
        with socket.create_connection(self.address, PATIENCE, source_address=source) as opened:
            self.struck.set()
            yield opened


def held(target, ended, *, count, first, drop):
    """Keep `count` connections open, with a drop a second; open them anew every 15 seconds."""
    while not ended.is_set():
        with ExitStack() as stack:
            opened = []
            for number in range(count):
                with suppress(OSError):
                    connection = stack.enter_context(target.connected(number))
                    connection.sendall(first)
                    opened.append(connection)
            for _ in range(15):
                if ended.wait(1):
                    return
                for connection in opened:
                    with suppress(OSError):
                        connection.sendall(drop)


def sent(target, ended, *, lanes, messages, read, pause=0.0, patience=PATIENCE):
    """Send messages in so many lanes, each on a connection of its own, and `read` what comes."""
    messages = list(messages())

    def lane(number):
        for message in itertools.islice(itertools.cycle(messages), number, None):
            if ended.wait(pause):
                return
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(patience)
                opened.sendall(message)
                read(opened, ended, number)

    threads = [threading.Thread(target=lane, args=(number,)) for number in range(lanes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def once(opened, ended, number):
    opened.recv(2**16)


def to_its_end(opened, ended, number):
    while opened.recv(2**16):
        pass


def half_of_it(opened, ended, number):
    """Every second lane reads, and the others leave."""
    if number % 2:
        to_its_end(opened, ended, number)


def slowly(opened, ended, number):
    while not ended.is_set() and opened.recv(64):
        ended.wait(1)


def endlessly(opened, ended, number):
    """Read nothing, and send chunks without end."""
    while not ended.is_set():
        opened.sendall(b"10000\r\n" + bytes(2**16) + b"\r\n")


def a_little(opened, ended, number):
    opened.recv(256)
    ended.wait(0.2 if number % 2 else 15)


def crumbs():
    yield head("POST", "/subdivide", CHUNKED) + b"1\r\nx\r\n" * 10_000


def for_routes_that_read_none():
    for path in ("/healthz", "/nothing", "/subdivide?levels=9", "/models"):
        yield head("POST", path, CHUNKED)


def pipelines():
    """Hundreds of requests on a connection before the first answer."""
    asked = [head("GET", path) for path in ("/healthz", "/limits", "/nothing", "/docs")]
    yield b"".join(itertools.islice(itertools.cycle(asked), 600))


def nonsense():
    """Bytes that are no HTTP, or nearly."""
    yield b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(64)
    yield b"GET / HTTP/9.9\r\n\r\n"
    yield b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n"
    yield b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 5000
    yield head("POST", "/subdivide", CHUNKED) + b"zz\r\n"
    yield b"GET /\x1b[31m HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-For: 1.1.1.1\r\n\r\n"
    yield b"GET /" + b"a" * 2**17
    yield head("POST", "/assets/../../etc/passwd")


def bombs():
    """Small files that ask for much: empty chunks, many nodes, deep levels, a zip of zeros."""

    def glb(tree, more=b""):
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + more
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    asset = {"asset": {"version": "2.0"}}
    yield whole("/subdivide?levels=6", glb(asset, struct.pack("<I4s", 0, b"abcd") * 300_000))
    yield whole("/subdivide?levels=6", glb(asset | {"nodes": [{}] * 100_000}))
    yield whole("/subdivide?levels=6", b"PK\x03\x04" + bytes(10_000))


def whiskers():
    """Polygons with a whisker of 16,000 corners and no width, which take long to cut badly."""
    there = [(8 + n, 0) for n in range(8_000)]
    outline = [(0, 0), (4, 1), (8, 0), *there, *reversed(there), (8, 8), (0, 8)]
    text = "".join(f"v {x} {y} 0\n" for x, y in outline)
    body = (text + "f " + " ".join(map(str, range(1, len(outline) + 1)))).encode()
    yield whole("/subdivide?polygons=off", body, kind="model/obj")


def streams():
    yield whole("/subdivide?levels=5", part_glb(), "Accept: multipart/mixed\r\n")


def documents():
    yield head("GET", "/docs/swagger-ui-bundle.js") * 8


UPLOAD = head("POST", "/subdivide", "Content-Length: 1000000\r\n")
ATTACKS = {
    "one-byte chunks": partial(sent, lanes=4, messages=crumbs, read=to_its_end),
    # As many as may arrive at the same time, and more.
    "trickling uploads": partial(held, count=96, first=UPLOAD, drop=b"x"),
    "endless heads": partial(held, count=200, first=b"GET /healthz HTTP/1.1\r\nX-A: ", drop=b"x"),
    # More connections than there are slots for, that say nothing.
    "idle connections": partial(held, count=700, first=b"", drop=b""),
    "unread bodies": partial(
        sent, lanes=4, messages=for_routes_that_read_none, read=endlessly, pause=0.5
    ),
    "slow readers": partial(sent, lanes=24, messages=documents, read=slowly),
    "pipelines": partial(sent, lanes=4, messages=pipelines, read=half_of_it, pause=0.2, patience=2),
    "nonsense": partial(sent, lanes=4, messages=nonsense, read=once, pause=0.02, patience=2),
    "bombs": partial(sent, lanes=2, messages=bombs, read=once, pause=0.2),
    "whiskers": partial(sent, lanes=6, messages=whiskers, read=once, pause=0.1),
    "streams that are left": partial(sent, lanes=12, messages=streams, read=a_little),
}
