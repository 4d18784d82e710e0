"""No client receives what belongs to another, whoever disconnects when."""

import asyncio
import hashlib
import random

from service.workers import pool
from tests.support import stand_in_jobs as jobs
from tests.support.live import served

ANSWERS = 1_000
# Each costs a worker's life, and the start of its successor.
DISCONNECTS = 32
HONEST = 32
RUDE = 8

Address = tuple[str, int]


async def sent(where, body, told):
    """A connection that has sent a whole request; its content type tells the worker more."""
    reader, writer = await asyncio.open_connection(*where)
    head = (
        "POST /subdivide HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
        f"Content-Type: model/gltf-binary; {told}\r\nContent-Length: {len(body)}\r\n\r\n"
    )
    writer.write(head.encode() + body)
    await writer.drain()
    return reader, writer


async def content(reader, writer):
    """The content of the answer."""
    try:
        head, _, rest = (await reader.read()).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200 "), head
        return rest
    finally:
        writer.close()
        await writer.wait_closed()


def digest(body):
    return hashlib.sha256(body).hexdigest().encode()


def test_answers_beside_clients_that_disconnect_are_each_of_their_own_input():
    chance = random.Random(7)
    bodies = [chance.randbytes(chance.randrange(1, 4096)) for _ in range(ANSWERS)]
    wrong = []

    async def honest(where, waiting):
        while waiting:
            number = waiting.pop()
            connection = await sent(where, bodies[number], "before=0; after=0.004")
            if await content(*connection) != digest(bodies[number]):
                wrong.append(number)

    async def rude(where, times):
        for _ in range(times):
            _, writer = await sent(where, chance.randbytes(1000), "before=0.1; after=0")
            await asyncio.sleep(chance.uniform(0, 0.15))
            writer.transport.abort()

    async def scenario(where):
        waiting = list(range(ANSWERS))
        async with asyncio.timeout(300), asyncio.TaskGroup() as clients:
            for _ in range(HONEST):
                clients.create_task(honest(where, waiting))
            for _ in range(RUDE):
                clients.create_task(rude(where, DISCONNECTS // RUDE))

    with served(jobs.digest, workers=4, queue=100, client_requests=104) as where:
        asyncio.run(scenario(where))
    assert wrong == []


def test_a_worker_that_outlives_its_request_writes_into_no_other_answer(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "GRACE_SECONDS", 30)
    late, patient = tmp_path / "late", tmp_path / "patient"
    late.mkdir()
    patient.mkdir()

    async def scenario(where):
        _, leaving = await sent(where, b"late", f"folder={late}")
        await until((late / "read").exists)
        leaving.transport.abort()
        for _ in range(5):
            # An answer on another connection: the server has been round its loop.
            reader, writer = await asyncio.open_connection(*where)
            writer.write(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
            await content(reader, writer)
        # Whatever the first request has closed by now, this one gets the numbers of.
        connection = await sent(where, b"patient", f"folder={patient}")
        (patient / "may-write").touch()
        await until((patient / "wrote").exists)
        (late / "may-write").touch()
        await until((late / "wrote").exists)
        for folder in (late, patient):
            (folder / "may-return").touch()
        assert await content(*connection) == digest(b"patient")

    # A client holds all workers but one.
    with served(jobs.digest_step_by_step, workers=3) as where:
        asyncio.run(asyncio.wait_for(scenario(where), 60))


async def until(holds):
    while not holds():
        await asyncio.sleep(0.002)
