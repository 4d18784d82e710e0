"""Two replicas that share their jobs in a Redis, one of them killed."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import AsyncMock

import httpx2
import pytest

from service.http.app import create_app
from service.http.jobs.shared import SharedJobs
from service.http.jobs.store import ANSWER, BODY, JobStore, Lease, RedisFiles
from service.settings import Settings
from service.workers.memory_file import MemoryFile
from tests.support import stand_in_jobs as jobs
from tests.support.live import local, served
from tests.support.proxy import free_port, proxied

GLB = {"Content-Type": "model/gltf-binary"}
RUNNING = re.compile(r"running on http://([\d.]+):(\d+)")
# A replica whose workers do what their bodies say, and whose death is noticed within two seconds.
REPLICA = """
from service import log_lines
from service.http.app import create_app
from service.http.jobs import shared, store
from service.http.server import DrainingServer
from service.settings import Settings
from service.workers.memory_file import MemoryFile
from tests.support import stand_in_jobs as jobs

if __name__ == "__main__":
    store.BEAT_SECONDS = shared.BEAT_SECONDS = 0.3
    store.LEASE_SECONDS = shared.LEASE_SECONDS = 2.0
    log_lines.configure()
    settings = Settings()
    stand_ins = {"job": jobs.obey, "measure": jobs.measure, "warm_up": jobs.no_warm_up}
    DrainingServer(create_app(settings, **stand_ins), settings).run()
"""
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a Redis of this test's own."""
    with redis_in(tmp_path_factory.mktemp("redis")) as address:
        yield address


@contextmanager
def redis_in(folder: Path, *options: str) -> Iterator[str]:
    """The address of a Redis that writes nowhere else."""
    program = shutil.which("redis-server")
    if program is None:
        pytest.skip("needs redis-server (Debian: redis-server)")
    port = free_port()
    command = [program, "--port", str(port), "--bind", "127.0.0.1", "--save", "", *options]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    while True:
        assert process.poll() is None
        with closing(socket.socket()) as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.02)
    yield f"redis://127.0.0.1:{port}/0"
    process.terminate()
    process.wait(30)


@contextmanager
def replicas(
    store: str, folder: Path, *each: dict[str, str]
) -> Iterator[list[tuple[str, subprocess.Popen[bytes]]]]:
    """Addresses of replicas in processes of their own, and the processes; started together."""
    script = folder / "replica.py"
    script.write_text(REPLICA)
    own = {"PNS_PORT": "0", "PNS_WORKERS": "1", "PNS_STORE": store, "PYTHONPATH": str(ROOT)}
    started = []
    try:
        for number, settings in enumerate(each):
            log = folder / f"log-{number}"
            with log.open("wb") as lines:
                process = subprocess.Popen(
                    [sys.executable, script], stderr=lines, env=os.environ | own | settings
                )
            started.append((log, process))
        yield [(address_in(log, process), process) for log, process in started]
    finally:
        for _, process in started:
            process.kill()
            process.wait()


def address_in(log: Path, process: subprocess.Popen[bytes]) -> str:
    while not (told := RUNNING.search(log.read_text())):
        assert process.poll() is None, log.read_text()
        time.sleep(0.05)
    return f"http://{told[1]}:{told[2]}"


def nobody(_: str) -> bool:
    """No job is held by the replica that looks for one."""
    return False


def seen(client: httpx2.Client, job: str, seconds: float) -> list[str]:
    """The states of a job as a client sees them one after the other, until it has long ended."""
    states: list[str] = []
    until = None
    while until is None or time.monotonic() < until:
        state = client.get(job).json()["state"]
        if states[-1:] != [state]:
            states.append(state)
        if until is None and state in ("done", "failed"):
            until = time.monotonic() + seconds
        time.sleep(0.02)
    return states


def hand_in(client: httpx2.Client, body: bytes, **headers: str) -> str:
    answer = client.post("/jobs", content=body, headers=GLB | headers)
    assert answer.status_code == 202, answer.text
    return f"/jobs/{answer.json()['id']}"


def ended(client: httpx2.Client, job: str) -> dict[str, Any]:
    while (view := client.get(job).json())["state"] in ("queued", "running"):
        time.sleep(0.05)
    return view


def opened(address: tuple[str, int]) -> httpx2.Client:
    return httpx2.Client(base_url=f"http://{address[0]}:{address[1]}", timeout=600)


@pytest.fixture(scope="module", params=["redis", "a folder"])
def pair(
    redis: str, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[httpx2.Client, httpx2.Client]]:
    """Clients of two replicas, whose files lie in Redis, or in a folder as in a bucket."""
    shared = {"workers": 1, "store": redis}
    if request.param != "redis":
        # In a database of their own: they would take other tests' jobs, whose files are in Redis.
        shared["store"] = redis.removesuffix("0") + "1"
        shared["store_files"] = f"file://{tmp_path_factory.mktemp('bucket')}"
    with (
        served(**shared) as one,
        served(**shared) as other,
        opened(one) as first,
        opened(other) as second,
    ):
        yield first, second


def test_any_replica_answers_for_any_job(pair: tuple[httpx2.Client, httpx2.Client]) -> None:
    first, second = pair
    job = hand_in(first, b"echo this")
    assert ended(second, job)["state"] == "done"
    for client in pair:
        for _ in range(2):
            assert client.get(f"{job}/result").content == b"echo this"
        assert client.get(f"{job}/report").headers["content-type"] == "application/json"
    assert second.delete(job).status_code == 204
    assert [client.get(job).status_code for client in pair] == [404, 404]
    assert first.get(f"{job}/result").status_code == 404


def test_a_problem_is_the_same_at_each_replica(pair: tuple[httpx2.Client, httpx2.Client]) -> None:
    job = hand_in(pair[0], b"broken", **{"X-Request-ID": "mine"})
    assert ended(pair[1], job)["state"] == "failed"
    answers = [client.get(f"{job}/result") for client in pair]
    assert [answer.status_code for answer in answers] == [422, 422]
    assert answers[0].json() == answers[1].json()
    assert answers[0].json()["request_id"] == "mine"


def test_events_are_told_by_another_replica(
    pair: tuple[httpx2.Client, httpx2.Client], tmp_path: Path
) -> None:
    job = hand_in(pair[0], f"steps {tmp_path}".encode())
    states = []
    with pair[1].stream("GET", f"{job}/events") as stream:
        for line in stream.iter_lines():
            if line.startswith("data: "):
                states.append(json.loads(line.removeprefix("data: "))["state"])
                for number in (1, 2, 3):
                    (tmp_path / f"go-{number}").touch()
    assert states[-1] == "done"


def test_a_job_is_cancelled_at_another_replica(
    pair: tuple[httpx2.Client, httpx2.Client], tmp_path: Path
) -> None:
    first, second = pair
    job = hand_in(first, f"steps {tmp_path}".encode())
    while not (tmp_path / "took-1").exists():
        time.sleep(0.01)
    assert second.delete(job).status_code == 204
    assert ended(second, job)["state"] == "cancelled"
    # Its worker is free.
    assert ended(first, hand_in(first, b"echo"))["state"] == "done"


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGTERM])
def test_no_job_is_lost_where_a_replica_is_killed(
    redis: str, tmp_path: Path, sent: signal.Signals
) -> None:
    """Half of the jobs are one replica's: one runs, the others wait. Each is done by the other."""
    with ExitStack() as stack:
        # A drain that does not wait for what still runs.
        two = stack.enter_context(replicas(redis, tmp_path, {"PNS_DRAIN_SECONDS": "0.1"}, {}))
        process = two[0][1]
        clients = [
            stack.enter_context(httpx2.Client(base_url=address, timeout=600)) for address, _ in two
        ]
        jobs = [hand_in(clients[0], f"steps {tmp_path}".encode())]
        jobs += [hand_in(clients[0], b"echo %d" % number) for number in range(3)]
        jobs += [hand_in(clients[1], b"echo %d" % number) for number in range(3, 6)]
        while not (tmp_path / "took-1").exists():
            time.sleep(0.01)
        process.send_signal(sent)
        process.wait(60)
        for number in (1, 2, 3):
            (tmp_path / f"go-{number}").touch()
        survivor = clients[1]
        assert [ended(survivor, job)["state"] for job in jobs] == ["done"] * len(jobs)
        contents = [survivor.get(f"{job}/result").content for job in jobs]
        assert contents[1:] == [b"echo %d" % number for number in range(6)]
        assert contents[0] == f"steps {tmp_path}".encode()


def test_a_replica_takes_no_connection_before_it_is_ready(redis: str) -> None:
    with served(workers=1, store=redis) as where, opened(where) as client:
        assert client.get("/readyz").status_code == 200


def test_a_replica_that_never_gets_ready_ends_when_it_is_told(redis: str, tmp_path: Path) -> None:
    script = tmp_path / "replica.py"
    script.write_text(REPLICA.replace("no_warm_up", "fails_to_warm_up"))
    port = free_port()
    own = {"PNS_PORT": str(port), "PNS_WORKERS": "1", "PNS_STORE": redis, "PYTHONPATH": str(ROOT)}
    with (tmp_path / "log").open("wb") as lines:
        process = subprocess.Popen([sys.executable, script], stderr=lines, env=os.environ | own)
    while b"this one is" not in (tmp_path / "log").read_bytes():
        assert process.poll() is None
        time.sleep(0.05)
    with closing(socket.socket()) as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0
    process.send_signal(signal.SIGTERM)
    assert process.wait(30) in (0, -signal.SIGTERM)


def test_without_its_store_a_replica_says_so_and_takes_no_job() -> None:
    store = f"redis://127.0.0.1:{free_port()}/0"
    with served(workers=1, store=store) as where, opened(where) as client:
        refused = client.post("/jobs", content=b"echo", headers=GLB)
        assert (refused.status_code, refused.json()["code"]) == (503, "store-unavailable")
        assert int(refused.headers["retry-after"]) >= 1
        # Where the store is concerns no client.
        assert "127.0.0.1" not in refused.text
        assert client.get("/jobs/none").status_code == 503
        # What needs no store is served.
        assert client.post("/subdivide", content=b"echo", headers=GLB).content == b"echo"


def test_a_job_that_ends_while_orphans_are_looked_for_keeps_its_result(
    redis: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is in the list of those that are open, and has no lease any more."""

    async def scenario() -> None:
        store = JobStore(Settings(store=redis))
        await store.create("ended", None, {}, {"state": "queued"}, [b"body"])
        await store.finish("ended", {"state": "done"}, {ANSWER: [b"answer"]}, ("a",))

        async def listed_before(_: str) -> set[bytes]:
            return {b"ended"}

        monkeypatch.setattr(store._redis, "smembers", listed_before)
        assert await store.take_orphan(nobody) is None
        record = await store.find("ended")
        assert record is not None
        assert record.view == {"state": "done"}
        with MemoryFile() as file:
            assert await store.file(ANSWER, "ended", file)
            assert b"".join(file.pieces()) == b"answer"
        await store.close()

    asyncio.run(scenario())


def test_a_job_whose_file_is_gone_has_failed(redis: str) -> None:
    """Its replica died, and the store has lost what was sent: nobody waits for it in vain."""
    shared = redis.removesuffix("0") + "2"

    view = {"state": "queued", "format": "glb"}

    async def lose_one() -> None:
        store = JobStore(Settings(store=shared))
        await store.create("lost", None, {"request_id": "mine", "client": "a"}, view, [b"body"])
        await store._files.delete(f"{BODY}:lost")
        await store.release("lost")
        await store.close()

    asyncio.run(lose_one())
    with served(workers=1, store=shared) as where, opened(where) as client:
        problem = ended(client, "/jobs/lost")["problem"]
        assert (problem["code"], problem["request_id"]) == ("store-unavailable", "mine")
        answer = client.get("/jobs/lost/result")
        assert (answer.status_code, answer.json()) == (503, problem)
        assert answer.headers["retry-after"] == "1"


def test_a_job_that_cannot_be_taken_over_keeps_no_other_from_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def adopt(*_: object) -> bool:
        # Not before it has failed once, and that was logged.
        assert "no options" in caplog.text, "no options"
        raise SystemExit

    monkeypatch.setattr("service.http.jobs.shared.LEASE_SECONDS", 0.04)
    settings = SimpleNamespace(result_bytes=1, results=1)
    service: Any = SimpleNamespace(settings=settings, admission=SimpleNamespace(draining=False))
    store = SimpleNamespace(answers=AsyncMock(return_value=True))
    shared = SharedJobs(service, cast("JobStore", store))
    # Of this one alone: replicas of other tests are still at work.
    monkeypatch.setattr(shared, "_adopt", adopt)
    with pytest.raises(SystemExit):
        asyncio.run(shared.adopt_for_ever())


def test_the_metrics_say_whether_the_store_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.http.jobs.shared.LEASE_SECONDS", 0.04)
    settings = Settings(workers=1, store=f"redis://127.0.0.1:{free_port()}/0")
    app = create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up)
    registry = app.state.metrics.registry
    with local(app):
        while registry.get_sample_value("pns_store_up"):
            time.sleep(0.01)
        monkeypatch.setattr(JobStore, "answers", AsyncMock(return_value=True))
        while not registry.get_sample_value("pns_store_up"):
            time.sleep(0.01)


def test_a_lease_keeps_a_job_from_other_replicas(redis: str) -> None:
    async def scenario() -> None:
        one, other = JobStore(Settings(store=redis)), JobStore(Settings(store=redis))
        await one.create("leased", None, {}, {"state": "queued"}, [b"body"])
        assert await other.take_orphan(nobody) is None
        await one.release("leased")
        record = await other.take_orphan(nobody)
        assert record is not None
        assert record.id == "leased"
        # Now it is the other's.
        assert await one.take_orphan(nobody) is None
        await one.cancel("leased")
        assert await other.beat("leased", {"state": "running"}) is Lease.CANCELLED
        await other.delete("leased")
        await one.close()
        await other.close()

    asyncio.run(scenario())


def test_where_the_store_is_full_a_job_ends_once_and_is_not_done_again(tmp_path: Path) -> None:
    """It keeps what it has, and the leases of jobs whose results it does not take."""
    full = ("--maxmemory", "12mb", "--maxmemory-policy", "noeviction")
    with (
        redis_in(tmp_path, *full) as store,
        replicas(store, tmp_path, {}) as ((address, _),),
        httpx2.Client(base_url=address, timeout=600) as client,
    ):
        kept = hand_in(client, b"large 3000000")
        assert ended(client, kept)["state"] == "done"
        refused = hand_in(client, b"large 3000000")
        # The lease of two seconds would have ended meanwhile.
        states = seen(client, refused, 5)
        assert [state for state in states if state != "queued"][-2:] == ["running", "failed"]
        assert states.count("failed") == 1
        answer = client.get(f"{refused}/result")
        assert (answer.status_code, answer.json()["code"]) == (503, "store-full")
        assert client.get(f"{kept}/result").content == bytes(3_000_000)
        # What it was to hold is free again: a small result fits.
        assert ended(client, hand_in(client, b"echo"))["state"] == "done"
    assert "a job is taken" not in (tmp_path / "log-0").read_text()


def test_a_job_is_done_only_once_its_result_is_stored(
    redis: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Storing it takes several times as long as a lease lasts, and a client asks both replicas."""
    shared = redis.removesuffix("0") + "3"
    for module in ("store", "shared"):
        monkeypatch.setattr(f"service.http.jobs.{module}.BEAT_SECONDS", 0.1)
        monkeypatch.setattr(f"service.http.jobs.{module}.LEASE_SECONDS", 0.5)
    write, tries = RedisFiles.write, []

    async def slow(self: RedisFiles, name: str, *rest: Any) -> None:
        if name.startswith(ANSWER):
            tries.append(name)
            await asyncio.sleep(1.5)
            if len(tries) == 1:
                raise TimeoutError("Timeout writing to socket")
        await write(self, name, *rest)

    monkeypatch.setattr(RedisFiles, "write", slow)
    monkeypatch.setattr("service.http.jobs.shared.AGAIN_SECONDS", (0.1,))
    with (
        served(workers=1, store=shared) as one,
        served(workers=1, store=shared) as other,
        opened(one) as first,
        opened(other) as second,
        ThreadPoolExecutor() as threads,
    ):
        job = hand_in(first, b"echo this")
        looks = [threads.submit(seen, client, job, 2) for client in (first, second)]
        for look in looks:
            assert look.result() in (["queued", "running", "done"], ["running", "done"])
        assert second.get(f"{job}/result").content == b"echo this"
    assert len(tries) == 2


def test_what_results_take_in_the_store_is_bounded_for_each_client(
    redis: str, tmp_path: Path
) -> None:
    """At any replica, and before the file is sent; who has fetched a result may have another."""
    shared = {"workers": 1, "store": redis.removesuffix("0") + "4", "result_bytes": 100_000}
    with (
        served(**shared) as one,
        served(**shared) as other,
        opened(one) as first,
        opened(other) as second,
    ):
        later = hand_in(second, f"steps {tmp_path}".encode())
        # A result and its report.
        done = hand_in(first, b"large 30000")
        assert ended(second, done)["state"] == "done"
        for number in (1, 2, 3):
            (tmp_path / f"go-{number}").touch()
        problem = ended(first, later)["problem"]
        assert (problem["status"], problem["code"]) == (503, "busy")
        refused = second.post("/jobs", content=b"echo", headers=GLB)
        assert (refused.status_code, refused.json()["code"]) == (503, "busy")
        assert int(refused.headers["retry-after"]) >= 1
        assert len(first.get(f"{done}/result").content) == 30_000
        # Its replica notes it a moment later.
        while (again := second.post("/jobs", content=b"large 30000", headers=GLB)).is_error:
            time.sleep(0.05)
        assert ended(second, f"/jobs/{again.json()['id']}")["state"] == "done"
        # It had to make room.
        assert first.get(done).status_code == 404


def test_a_replica_that_has_lost_its_lease_changes_nothing(
    redis: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.http.jobs.store.LEASE_SECONDS", 0.05)

    async def scenario() -> None:
        one, other = JobStore(Settings(store=redis)), JobStore(Settings(store=redis))
        await one.create("lost", None, {}, {"state": "queued"}, [b"body"])
        await asyncio.sleep(0.1)
        # Not from itself, as long as it has the job.
        assert await one.take_orphan(lambda name: name == "lost") is None
        monkeypatch.setattr("service.http.jobs.store.LEASE_SECONDS", 10)
        record = await other.take_orphan(nobody)
        assert record is not None
        assert record.replica == one.replica
        assert await one.beat("lost", {"state": "late"}) is Lease.LOST
        await one.release("lost")
        await one.finish("lost", {"state": "late"}, {}, ("a",))
        assert await other.beat("lost", {"state": "running"}) is Lease.HELD
        await other.finish("lost", {"state": "done"}, {}, ("a",))
        # Nor after the end.
        assert await other.beat("lost", {"state": "running"}) is Lease.LOST
        record = await one.find("lost")
        assert record is not None
        assert record.view == {"state": "done"}
        await one.delete("lost")
        await one.close()
        await other.close()

    asyncio.run(scenario())


def test_no_request_fails_behind_the_proxy_while_one_of_two_replicas_stops(
    redis: str, tmp_path: Path
) -> None:
    """It has a job that runs, so it stops for a while, and takes nothing new."""
    behind = {"PNS_PROXIES": "127.0.0.1"}
    with ExitStack() as stack:
        two = stack.enter_context(replicas(redis, tmp_path, behind, behind))
        ends = [(url.host, url.port) for url in (httpx2.URL(address) for address, _ in two)]
        front = stack.enter_context(proxied(ends[0], tmp_path, *ends[1:]))
        client = stack.enter_context(opened(front))
        first = stack.enter_context(httpx2.Client(base_url=two[0][0], timeout=600))
        job = hand_in(first, f"steps {tmp_path}".encode())
        while not (tmp_path / "took-1").exists():
            time.sleep(0.01)
        two[0][1].send_signal(signal.SIGTERM)
        statuses = []
        while "draining" not in (tmp_path / "log-0").read_text() or len(statuses) < 20:
            answer = client.post("/subdivide", content=b"short", headers=GLB)
            statuses.append(answer.status_code)
            time.sleep(0.02)
        assert set(statuses) == {200}
        assert two[0][1].poll() is None
        for number in (1, 2, 3):
            (tmp_path / f"go-{number}").touch()
        assert ended(client, job)["state"] == "done"
        two[0][1].wait(60)
