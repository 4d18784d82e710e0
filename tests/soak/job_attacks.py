"""Attacks on jobs: followed by many, handed in and left, fetched slowly, struck out."""

from __future__ import annotations

import itertools
import json
import socket
import struct
from contextlib import suppress
from multiprocessing.synchronize import Event

from tests.soak.bodies import large_body, small_body
from tests.soak.target import PATIENCE, Target, head, hold, side_by_side


def followers(target: Target, ended: Event) -> None:
    """More streams of one job's events than there are slots, of which nothing is read.

    From fewer addresses than there are slots: who has one connection is then never refused.
    """
    body = large_body()
    while not ended.is_set():
        job = _handed_in(target, 0, body, "levels=4&scheme=loop", prepares=True)
        if job is not None:
            asks = head("GET", f"/jobs/{job}/events")
            hold(target, ended, 700, asks, b"", seconds=5, addresses=40)
        ended.wait(0.5)


def come_and_go(target: Target, ended: Event) -> None:
    """Jobs that are left at once, or struck out: while they run, while they are fetched."""
    bodies = [small_body(), large_body()]

    def connect(number: int) -> None:
        turns = itertools.product(bodies, (_leave, _strike_out, _fetch_slowly))
        for body, then in itertools.islice(itertools.cycle(turns), number, None):
            if ended.wait(0.1):
                return
            with suppress(OSError):
                job = _handed_in(target, number, body, "levels=3&scheme=loop")
                if job is not None:
                    then(target, number, job)

    side_by_side(connect, 4)


def leavers(target: Target, ended: Event) -> None:
    """One large result, asked for again and again and left after its first bytes."""
    job = None
    while job is None:
        if ended.wait(0.1):
            return
        job = _handed_in(target, 0, large_body(), "levels=4&scheme=loop", prepares=True)
    _follow(target, 0, job)
    asks = head("GET", f"/jobs/{job}/result")

    def connect(number: int) -> None:
        while not ended.wait(0.005):
            with suppress(OSError), target.connected(number) as opened:
                # Closed by a reset, with most of the answer still to come.
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                opened.sendall(asks)
                opened.recv(2**10)

    side_by_side(connect, 4)


def deletes(target: Target, ended: Event) -> None:
    """Thousands of jobs struck out that there never were."""
    requests = b"".join(head("DELETE", f"/jobs/{number:032d}") for number in range(500))

    def connect(number: int) -> None:
        while not ended.wait(0.1):
            with suppress(OSError), target.connected(number) as opened:
                opened.settimeout(5)
                opened.sendall(requests)
                for _ in range(50):
                    opened.recv(2**16)

    side_by_side(connect, 4)


def _handed_in(
    target: Target, number: int, body: bytes, query: str, *, prepares: bool = False
) -> str | None:
    """The id of a new job, where it is accepted."""
    with suppress(OSError), target.connected(number, prepares=prepares) as opened:
        asks = head("POST", f"/jobs?{query}", f"Content-Length: {len(body)}\r\n")
        opened.sendall(asks + body)
        said = opened.recv(2**16)
        if said.startswith(b"HTTP/1.1 202 "):
            return json.loads(said.partition(b"\r\n\r\n")[2] or opened.recv(2**16))["id"]
    return None


def _leave(target: Target, number: int, job: str) -> None:
    pass


def _strike_out(target: Target, number: int, job: str) -> None:
    for _ in range(2):
        with target.connected(number) as opened:
            opened.sendall(head("DELETE", f"/jobs/{job}"))
            opened.recv(2**10)


def _fetch_slowly(target: Target, number: int, job: str) -> None:
    _follow(target, number, job)
    with target.connected(number) as opened:
        # Little room at this end: what is not read stays the service's.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2**12)
        opened.sendall(head("GET", f"/jobs/{job}/result"))
        opened.recv(64)
        _strike_out(target, number, job)
        opened.recv(64)


def _follow(target: Target, number: int, job: str) -> None:
    """Come back when the job has ended."""
    with target.connected(number, prepares=True) as opened:
        opened.settimeout(PATIENCE)
        opened.sendall(head("GET", f"/jobs/{job}/events", "Connection: close\r\n"))
        while opened.recv(2**16):
            pass
