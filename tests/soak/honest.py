"""Clients that mean well: some slow, some that leave, and a probe."""

from __future__ import annotations

import hashlib
import http.client
import random
import socket
import threading
import time
from contextlib import closing, suppress
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event

from tests.soak.samples import Sample
from tests.soak.tally import Tally

PATIENCE = 120
Address = tuple[str, int]


def connection(address: Address) -> http.client.HTTPConnection:
    """A connection that gives up after `PATIENCE`."""
    return http.client.HTTPConnection(*address, timeout=PATIENCE)


def wait_until_ready(address: Address) -> None:
    """Wait until a worker has the model."""
    for _ in range(1200):
        with closing(connection(address)) as opened, suppress(OSError):
            opened.request("GET", "/readyz")
            if opened.getresponse().status == 200:
                return
        time.sleep(0.1)
    raise TimeoutError("the service is not ready")


def honest(
    address: Address, samples: list[Sample], tally: Tally, ended: threading.Event, seed: int
) -> None:
    """One request after another, in any format; every answer is compared."""
    rng = random.Random(seed)
    while not ended.is_set():
        sample = rng.choice(samples)
        began = time.perf_counter()
        status, digest, retry = _ask(address, sample)
        tally.answer(sample.name.partition("-")[0], status)
        if status == 200:
            tally.took(
                "small job" if sample.name == "small" else "job", time.perf_counter() - began
            )
            if digest != sample.digest:
                tally.mistake(f"{sample.name}: {digest}")
        elif status in (429, 503):
            ended.wait(min(retry, 2))
        elif status:
            tally.mistake(f"{sample.name}: {status}")
        ended.wait(rng.uniform(0, 0.1))


def _ask(address: Address, sample: Sample) -> tuple[int, str, float]:
    with closing(connection(address)) as opened:
        try:
            opened.request(
                "POST",
                f"/subdivide?{sample.query}",
                sample.body,
                {"Content-Type": sample.content_type},
            )
            answer = opened.getresponse()
            content = answer.read()
        except (OSError, http.client.HTTPException):
            # Refused or cut off: where that was right, the attacks' own tests say.
            return 0, "", 1.0
        retry = float(answer.headers.get("Retry-After", 1))
        return answer.status, hashlib.sha256(content).hexdigest(), retry


def large(address: Address, body: bytes, tally: Tally, ended: threading.Event) -> None:
    """Jobs of seconds, without end."""
    while not ended.is_set():
        with closing(connection(address)) as opened, suppress(OSError, http.client.HTTPException):
            opened.request(
                "POST",
                "/subdivide?levels=4&scheme=loop",
                body,
                {"Content-Type": "model/gltf-binary", "Accept": "application/json"},
            )
            answer = opened.getresponse()
            answer.read()
            tally.answer("large", answer.status)
            if answer.status in (429, 503):
                ended.wait(min(float(answer.headers.get("Retry-After", 1)), 5))
        ended.wait(2)


def slow(address: Address, samples: list[Sample], tally: Tally, ended: threading.Event) -> None:
    """Uploads and reads at 64 KiB a second: slow, and within what is allowed."""
    sample = next(sample for sample in samples if sample.name.startswith("obj"))
    head = (
        f"POST /subdivide?{sample.query} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
        f"Content-Type: {sample.content_type}\r\nContent-Length: {len(sample.body)}\r\n\r\n"
    )
    while not ended.is_set():
        with suppress(OSError), socket.create_connection(address, timeout=PATIENCE) as opened:
            opened.sendall(head.encode())
            for start in range(0, len(sample.body), 2**13):
                opened.sendall(sample.body[start : start + 2**13])
                ended.wait(1 / 8)
            answer = b""
            while piece := opened.recv(2**13):
                answer += piece
                ended.wait(1 / 8)
            if not answer:
                # Cut off, as the slowest of all, for a new connection.
                tally.answer("slow", 0)
                continue
            got, _, content = answer.partition(b"\r\n\r\n")
            status = int(got.split(maxsplit=2)[1])
            tally.answer("slow", status)
            if status == 200 and hashlib.sha256(content).hexdigest() != sample.digest:
                tally.mistake(f"slow {sample.name}")


def leaving(
    address: Address, samples: list[Sample], tally: Tally, ended: threading.Event, seed: int
) -> None:
    """Clients that go at any moment: in the upload, in the job, in the answer."""
    rng = random.Random(seed)
    while not ended.is_set():
        sample = rng.choice(samples)
        head = (
            f"POST /subdivide?{sample.query} HTTP/1.1\r\nHost: localhost\r\n"
            f"Content-Type: {sample.content_type}\r\nContent-Length: {len(sample.body)}\r\n\r\n"
        )
        message = head.encode() + sample.body
        with suppress(OSError), socket.create_connection(address, timeout=PATIENCE) as opened:
            opened.sendall(message[: rng.choice([10, len(head), len(message) // 2, len(message)])])
            ended.wait(rng.uniform(0, 0.1))
        tally.answer("leaving", 0)


def probe(address: Address, ended: Event, answers: Connection) -> None:
    """GET /healthz, ten times a second, each on a new connection; tells status and seconds.

    Who has connected and said nothing while as many others came as there are slots gives way to
    them. A process that waits for its processor between the two may be that one: it asks again, as
    clients do where a connection ends before the answer begins. Three times in a row is no chance.
    """
    while not ended.is_set():
        began = time.perf_counter()
        status = _healthz(address) or _healthz(address) or _healthz(address)
        answers.send((status, time.perf_counter() - began))
        ended.wait(0.1)


def _healthz(address: Address) -> int:
    """The status; 0 where there is no answer."""
    with closing(connection(address)) as opened, suppress(OSError, http.client.HTTPException):
        opened.request("GET", "/healthz")
        return opened.getresponse().status
    return 0
