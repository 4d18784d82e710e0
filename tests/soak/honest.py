"""Clients that mean well: some slow, some that leave, and a probe."""

import hashlib
import http.client
import random
import socket
import time
from contextlib import closing, suppress

PATIENCE = 120
FAILED = OSError, http.client.HTTPException


def connection(address):
    """A connection that gives up after `PATIENCE`."""
    return closing(http.client.HTTPConnection(*address, timeout=PATIENCE))


def wait_until_ready(address):
    """Wait until a worker has the model."""
    for _ in range(1200):
        with connection(address) as opened, suppress(OSError):
            opened.request("GET", "/readyz")
            if opened.getresponse().status == 200:
                return
        time.sleep(0.1)
    raise TimeoutError("the service is not ready")


def asked(address, query, body, **headers):
    """Status, sha256 of the content, and seconds until it is to be asked again."""
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    with connection(address) as opened:
        try:
            opened.request("POST", f"/subdivide?{query}", body, headers)
            answer = opened.getresponse()
            digest = hashlib.sha256(answer.read()).hexdigest()
        except FAILED:
            # Refused or cut off: where that was right, the attacks' own tests say.
            return 0, "", 1.0
        return answer.status, digest, float(answer.headers.get("Retry-After", 1))


def honest(address, samples, tally, ended, seed):
    """One request after another, in any format; every answer is compared."""
    rng = random.Random(seed)
    while not ended.is_set():
        sample = rng.choice(samples)
        began = time.perf_counter()
        kind = sample.content_type
        status, digest, retry = asked(address, sample.query, sample.body, Content_Type=kind)
        tally.answer(sample.name.partition("-")[0], status)
        if status == 200:
            what = "small job" if sample.name == "small" else "job"
            tally.took(what, time.perf_counter() - began)
            if digest != sample.digest:
                tally.mistake(f"{sample.name}: {digest}")
        elif status in (429, 503):
            ended.wait(min(retry, 2))
        elif status:
            tally.mistake(f"{sample.name}: {status}")
        ended.wait(rng.uniform(0, 0.1))


def large(address, body, tally, ended):
    """Jobs of seconds, without end."""
    kinds = {"Content_Type": "model/gltf-binary", "Accept": "application/json"}
    while not ended.is_set():
        status, _, retry = asked(address, "levels=4&scheme=loop", body, **kinds)
        if status:
            tally.answer("large", status)
        if status in (429, 503):
            ended.wait(min(retry, 5))
        ended.wait(2)


def head_of(sample):
    return (
        f"POST /subdivide?{sample.query} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
        f"Content-Type: {sample.content_type}\r\nContent-Length: {len(sample.body)}\r\n\r\n"
    ).encode()


def slow(address, samples, tally, ended):
    """Uploads and reads at 64 KiB a second: slow, and within what is allowed."""
    sample = next(sample for sample in samples if sample.name.startswith("obj"))
    while not ended.is_set():
        with suppress(OSError), socket.create_connection(address, timeout=PATIENCE) as opened:
            opened.sendall(head_of(sample))
            for start in range(0, len(sample.body), 2**13):
                opened.sendall(sample.body[start : start + 2**13])
                ended.wait(1 / 8)
            answer = b""
            while piece := opened.recv(2**13):
                answer += piece
                ended.wait(1 / 8)
            got, _, content = answer.partition(b"\r\n\r\n")
            # Without an answer it was cut off, as the slowest of all, for a new connection.
            status = int(got.split(maxsplit=2)[1]) if answer else 0
            tally.answer("slow", status)
            if status == 200 and hashlib.sha256(content).hexdigest() != sample.digest:
                tally.mistake(f"slow {sample.name}")


def leaving(address, samples, tally, ended, seed):
    """Clients that go at any moment: in the upload, in the job, in the answer."""
    rng = random.Random(seed)
    while not ended.is_set():
        sample = rng.choice(samples)
        head = head_of(sample)
        message = head + sample.body
        with suppress(OSError), socket.create_connection(address, timeout=PATIENCE) as opened:
            opened.sendall(message[: rng.choice([10, len(head), len(message) // 2, len(message)])])
            ended.wait(rng.uniform(0, 0.1))
        tally.answer("leaving", 0)


def probe(address, ended, answers):
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


def _healthz(address):
    """The status; 0 where there is no answer."""
    with connection(address) as opened, suppress(*FAILED):
        opened.request("GET", "/healthz")
        return opened.getresponse().status
    return 0
