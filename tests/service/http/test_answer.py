"""The answer by itself: what it reads for a client, and for one who is gone."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest
from starlette.types import Message, Scope

from service.errors import BusyError
from service.http.admission import Admission
from service.http.answer import FileAnswer
from service.http.layers import Head
from service.workers.memory_file import PIECE, MemoryFile

PIECES = 12


class CountedFile(MemoryFile):
    """A memory file that counts the pieces that were read of it."""

    read = 0

    def pieces(self) -> Iterator[bytes]:
        for piece in super().pieces():
            self.read += 1
            yield piece


@dataclass
class Client:
    """Takes so many messages and leaves; a server then takes what is sent, and drops it."""

    takes: float
    got: list[Message] = field(default_factory=list)
    left: asyncio.Event = field(default_factory=asyncio.Event)

    async def send(self, message: Message) -> None:
        if self.left.is_set():
            return
        self.got.append(message)
        if len(self.got) >= self.takes:
            self.left.set()

    async def receive(self) -> Message:
        await self.left.wait()
        return {"type": "http.disconnect"}


def answered(
    method: str,
    client: Client,
    sent: Callable[[], None] = lambda: None,
    taken: int = 0,
) -> tuple[CountedFile, Admission]:
    """Answer a request with a file of so many pieces, while another client takes so many bytes."""
    admission = Admission(uploads=1, body_bytes=1, answer_bytes=PIECES * PIECE)
    scope: Scope = {"type": "http", "method": method, "headers": []}

    async def scenario(file: CountedFile) -> None:
        answer = FileAnswer(
            file,
            admission,
            "a",
            stall_seconds=60,
            media_type="model/gltf-binary",
            headers={},
            sent=sent,
        )
        async with admission.answering("b", taken):
            await asyncio.wait_for(Head(answer)(scope, client.receive, client.send), 10)

    file = CountedFile()
    file.append(bytes(PIECES * PIECE))
    asyncio.run(scenario(file))
    return file, admission


def test_whoever_stays_gets_all_of_it() -> None:
    client = Client(takes=float("inf"))
    file, _ = answered("GET", client)
    start, *pieces = client.got
    assert dict(start["headers"])[b"content-length"] == str(PIECES * PIECE).encode()
    assert [len(message["body"]) for message in pieces] == [PIECE] * PIECES + [0]
    assert [message.get("more_body", False) for message in pieces] == [True] * PIECES + [False]
    assert file.closed


@pytest.mark.parametrize("takes", [1, 2, 5])
def test_nothing_is_read_for_one_who_is_gone(takes: int) -> None:
    file, admission = answered("GET", Client(takes))
    assert file.read == takes - 1
    assert file.closed
    assert admission.admitted == 0


@pytest.mark.parametrize(
    ("method", "takes", "whole"),
    [
        ("GET", float("inf"), True),
        ("GET", PIECES + 1, True),  # it leaves with the last piece, by its Content-Length
        ("GET", PIECES, False),
        ("HEAD", float("inf"), False),
    ],
)
def test_an_answer_was_sent_once_all_of_it_was(method: str, takes: float, whole: bool) -> None:
    told: list[bool] = []
    answered(method, Client(takes), lambda: told.append(True))
    assert told == [True] * whole


def test_an_answer_that_is_refused_was_not_sent() -> None:
    told: list[bool] = []
    with pytest.raises(BusyError):
        answered("GET", Client(takes=float("inf")), lambda: told.append(True), taken=1)
    assert told == []


def test_a_head_alone_reads_nothing() -> None:
    client = Client(takes=float("inf"))
    file, _ = answered("HEAD", client)
    assert file.read == 0
    assert [message["type"] for message in client.got] == [
        "http.response.start",
        "http.response.body",
    ]
