"""Jobs: handed in, looked at, followed, fetched, cancelled, forgotten."""

from __future__ import annotations

import json
import re
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest

from service.http import documentation
from tests.support.live import served
from tests.support.stand_in_jobs import files_of_at_most, measure_in_the_end

GLB = {"Content-Type": "model/gltf-binary"}
JSON = {"Accept": "application/json"}


@pytest.fixture(scope="module")
def client() -> Iterator[httpx2.Client]:
    with served(workers=1, queue=4) as where, opened(where) as session:
        yield session


def opened(where: tuple[str, int]) -> httpx2.Client:
    return httpx2.Client(base_url=f"http://{where[0]}:{where[1]}", timeout=600)


def hand_in(client: httpx2.Client, body: bytes) -> httpx2.Response:
    return client.post("/jobs", content=body, headers=GLB)


def started(client: httpx2.Client, body: bytes) -> str:
    answer = hand_in(client, body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


def state(client: httpx2.Client, job: str) -> dict[str, Any]:
    return client.get(f"/jobs/{job}").json()


def until(holds: Callable[[], bool]) -> None:
    while not holds():
        time.sleep(0.005)


def ended(client: httpx2.Client, job: str) -> dict[str, Any]:
    until(lambda: state(client, job)["state"] in ("done", "failed", "cancelled"))
    return state(client, job)


def test_a_job_is_accepted_done_and_fetched_as_often_as_wanted(client: httpx2.Client) -> None:
    answer = hand_in(client, b"echo this")
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["location"] == f"/jobs/{job['id']}"
    assert set(job) == set(documentation.JOB_FIELDS)
    assert job["state"] in ("queued", "running", "done")
    done = ended(client, job["id"])
    assert done["state"] == "done"
    assert done["share"] == 1
    assert done["problem"] is None
    for _ in range(2):
        result = client.get(f"/jobs/{job['id']}/result")
        assert result.content == b"echo this"
        assert result.headers["content-type"] == "model/gltf-binary"
        assert re.fullmatch(
            r"upload;dur=[\d.]+, queue;dur=[\d.]+(, \w+;dur=[\d.]+)*",
            result.headers["server-timing"],
        )
    report = client.get(f"/jobs/{job['id']}/result", headers=JSON)
    assert report.headers["content-type"] == "application/json"


def test_ids_are_long_and_never_the_same(client: httpx2.Client) -> None:
    ids = {started(client, b"echo") for _ in range(3)}
    assert len(ids) == 3
    assert min(map(len, ids)) >= 32


def test_a_job_moves_inside_and_its_events_tell(client: httpx2.Client, tmp_path: Path) -> None:
    job = started(client, f"steps {tmp_path}".encode())
    told: list[dict[str, Any]] = []
    with client.stream("GET", f"/jobs/{job}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        lines = stream.iter_lines()
        for line in lines:
            if not line.startswith("data: "):
                assert line in ("", "event: progress")
                continue
            told.append(json.loads(line.removeprefix("data: ")))
            share = told[-1]["share"]
            # Each step is told of before the next may be taken.
            if told[-1]["state"] == "running" and share:
                (tmp_path / f"go-{round(4 * share)}").touch()
    shares = [event["share"] for event in told]
    assert {0.25, 0.5, 0.75, 1.0} <= set(shares)
    assert shares == sorted(shares)
    assert "refine" in {event["stage"] for event in told}
    assert told[-1]["state"] == "done"
    assert told[-1]["estimate_seconds"] == 0


def test_a_result_that_is_not_there_yet_is_409(client: httpx2.Client, tmp_path: Path) -> None:
    job = started(client, f"steps {tmp_path}".encode())
    early = client.get(f"/jobs/{job}/result")
    assert early.status_code == 409
    assert early.json()["code"] == "job-not-done"
    for number in (1, 2, 3):
        (tmp_path / f"go-{number}").touch()
    assert ended(client, job)["state"] == "done"


def test_a_job_that_fails_keeps_its_problem(client: httpx2.Client) -> None:
    job = started(client, b"broken")
    failed = ended(client, job)
    assert failed["state"] == "failed"
    assert failed["problem"]["pointer"] == "/accessors/3/count"
    result = client.get(f"/jobs/{job}/result")
    assert result.status_code == 422
    # Each answer names its own request.
    assert result.json() == failed["problem"]


def test_a_failed_job_names_the_request_that_the_log_has_it_under(client: httpx2.Client) -> None:
    answer = client.post("/jobs", content=b"fault", headers=GLB | {"X-Request-ID": "handed-in"})
    failed = ended(client, answer.json()["id"])
    assert failed["problem"]["request_id"] == "handed-in"


def test_a_fault_of_ours_is_not_explained(client: httpx2.Client) -> None:
    failed = ended(client, started(client, b"fault"))
    assert failed["problem"]["code"] == "internal-error"
    assert "secret" not in str(failed)


def test_delete_stops_a_job_and_the_same_worker_takes_the_next(
    client: httpx2.Client, tmp_path: Path
) -> None:
    job = started(client, f"steps {tmp_path}".encode())
    until((tmp_path / "took-1").exists)
    worker = int((tmp_path / "took-1").read_text())
    assert client.delete(f"/jobs/{job}").status_code == 204
    assert state(client, job)["state"] == "cancelled"
    # It ended itself where it next looked: nothing else would have let it take this one.
    freed = client.post("/subdivide", content=b"pid", headers=GLB)
    assert int(freed.content) == worker
    assert client.get(f"/jobs/{job}/result").status_code == 409
    # Once more: it is forgotten.
    assert client.delete(f"/jobs/{job}").status_code == 204
    assert client.get(f"/jobs/{job}").status_code == 404


def test_delete_kills_a_worker_that_does_not_look(client: httpx2.Client) -> None:
    before = client.post("/subdivide", content=b"pid", headers=GLB).content
    job = started(client, b"hold")
    until(lambda: state(client, job)["state"] == "running")
    assert client.delete(f"/jobs/{job}").status_code == 204
    assert client.post("/subdivide", content=b"pid", headers=GLB).content != before


def test_a_job_that_waits_has_a_place_in_line_and_can_be_cancelled(
    client: httpx2.Client, tmp_path: Path
) -> None:
    first = started(client, f"steps {tmp_path}".encode())
    until((tmp_path / "took-1").exists)
    waiting = [started(client, b"echo") for _ in range(2)]
    assert [state(client, job)["queue_place"] for job in waiting] == [0, 1]
    assert state(client, first)["queue_place"] is None
    assert client.delete(f"/jobs/{waiting[0]}").status_code == 204
    assert state(client, waiting[1])["queue_place"] == 0
    assert client.delete(f"/jobs/{first}").status_code == 204
    assert ended(client, waiting[1])["state"] == "done"


def test_a_disconnect_does_not_lose_a_job(tmp_path: Path) -> None:
    with served(workers=1) as where:
        with opened(where) as leaving:
            job = started(leaving, f"steps {tmp_path}".encode())
            with leaving.stream("GET", f"/jobs/{job}/events") as stream:
                next(stream.iter_lines())
        for number in (1, 2, 3):
            (tmp_path / f"go-{number}").touch()
        with opened(where) as back:
            assert ended(back, job)["state"] == "done"


def test_who_leaves_before_a_job_stands_in_line_leaves_nothing(tmp_path: Path) -> None:
    """Nobody was told its id; and those that wait to be measured take no slot."""
    results, told = tmp_path / "results", tmp_path / "told"
    results.mkdir()
    told.mkdir()
    body = f"measured {told}"
    head = f"POST /jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: {GLB['Content-Type']}\r\n"
    request = f"{head}Content-Length: {len(body)}\r\n\r\n{body}".encode()
    with served(workers=1, measure=measure_in_the_end, result_folder=results) as where:
        clients = [socket.create_connection(where) for _ in range(3)]
        # Two are measured, and the third waits; each has an answer and a report.
        for client in clients:
            client.sendall(request)
        until(lambda: len(list(told.glob("began-*"))) == 2 and len(kept_in(results)) == 6)
        for client in clients:
            client.close()
        until(lambda: kept_in(results) == [])


def test_unknown_ids_are_404(client: httpx2.Client) -> None:
    for method, path in (
        ("GET", "/jobs/nobody"),
        ("GET", "/jobs/nobody/events"),
        ("GET", "/jobs/nobody/result"),
        ("DELETE", "/jobs/nobody"),
    ):
        answer = client.request(method, path)
        assert answer.status_code == 404
        assert answer.json()["code"] == "no-such-job"


def test_a_bad_parameter_and_a_bad_type_are_refused_at_once(client: httpx2.Client) -> None:
    assert client.post("/jobs?levels=7", content=b"echo", headers=GLB).status_code == 422
    assert client.post("/jobs", content=b"echo", headers={"Content-Type": "a/b"}).status_code == 415


def test_results_are_forgotten_in_time_and_by_size(tmp_path: Path) -> None:
    with (
        served(workers=1, result_seconds=0.2, result_folder=tmp_path) as where,
        opened(where) as client,
    ):
        job = started(client, b"echo")
        until(lambda: client.get(f"/jobs/{job}").status_code == 404)
    with (
        served(
            workers=1, result_bytes=1000, result_folder=tmp_path, promised_seconds=1e-9
        ) as where,
        opened(where) as client,
    ):
        # Answer and report hold the same here.
        first, second, third = (
            started(client, f"large {size}".encode()) for size in (200, 250, 50)
        )
        ended(client, third)
        assert client.get(f"/jobs/{first}").status_code == 200
        last = started(client, b"large 100")
        until(lambda: client.get(f"/jobs/{first}").status_code == 404)
        assert [ended(client, job)["state"] for job in (second, third, last)] == ["done"] * 3


def test_a_result_that_finds_no_room_beside_promised_ones_fails_and_says_when_to_come_back(
    tmp_path: Path,
) -> None:
    with (
        served(workers=1, result_bytes=1000, result_folder=tmp_path) as where,
        opened(where) as client,
    ):
        first, second = (started(client, f"large {size}".encode()) for size in (200, 250))
        failed = ended(client, second)
        assert (failed["state"], failed["problem"]["code"]) == ("failed", "busy")
        refused = client.get(f"/jobs/{second}/result")
        assert refused.status_code == 503
        assert int(refused.headers["retry-after"]) >= 1
        # The first is there, and once it is fetched leaves its room.
        assert client.get(f"/jobs/{first}/result").status_code == 200
        assert ended(client, started(client, b"large 250"))["state"] == "done"


def test_results_lie_on_disk_without_a_name(tmp_path: Path) -> None:
    with served(workers=1, result_folder=tmp_path) as where, opened(where) as client:
        job = started(client, b"large 100000")
        assert ended(client, job)["state"] == "done"
        kept = kept_in(tmp_path)
        assert len(kept) == 2
        assert all(path.endswith("(deleted)") for path in kept)
        assert list(tmp_path.iterdir()) == []


def test_a_folder_that_can_be_written_no_more_is_503(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    with served(workers=1, result_folder=folder) as where, opened(where) as client:
        folder.rmdir()
        refused = hand_in(client, b"echo")
        assert refused.status_code == 503
        assert refused.json()["code"] == "no-storage"


@pytest.mark.parametrize("route", ["/subdivide", "/jobs"])
def test_a_body_that_does_not_fit_is_503_and_nothing_of_it_stays(
    client: httpx2.Client, route: str
) -> None:
    """The server's own writes are refused, as those of a full disk or memory are."""
    before = descriptors()
    with files_of_at_most(2**20):
        refused = client.post(route, content=bytes(2**21), headers=GLB)
    assert refused.status_code == 503
    assert refused.json()["code"] == "no-storage"
    assert client.post("/subdivide", content=b"echo", headers=GLB).content == b"echo"
    until(lambda: descriptors() <= before)


def test_a_result_that_is_struck_out_while_it_is_fetched_arrives_whole(
    client: httpx2.Client,
) -> None:
    client.post("/subdivide", content=b"echo", headers=GLB)
    before = descriptors()
    job = started(client, b"large 30000000")
    assert ended(client, job)["state"] == "done"
    with client.stream("GET", f"/jobs/{job}/result") as answer:
        pieces = answer.iter_bytes()
        taken = len(next(pieces))
        assert client.delete(f"/jobs/{job}").status_code == 204
        assert client.get(f"/jobs/{job}").status_code == 404
        # More than the sockets hold: the rest is read after its end.
        assert taken + sum(map(len, pieces)) == 30_000_000
    until(lambda: descriptors() <= before)


def test_a_result_that_nobody_takes_is_let_go() -> None:
    with (
        served(workers=1, stall_seconds=0.5) as where,
        opened(where) as client,
        opened(where) as slow,
    ):
        client.post("/subdivide", content=b"echo", headers=GLB)
        before = descriptors()
        job = started(client, b"large 30000000")
        assert ended(client, job)["state"] == "done"
        with slow.stream("GET", f"/jobs/{job}/result"):
            client.delete(f"/jobs/{job}")
            until(lambda: descriptors() <= before)


def test_a_result_that_does_not_fit_fails_by_name_and_its_room_is_free(tmp_path: Path) -> None:
    with served(workers=1, result_folder=tmp_path) as where, opened(where) as client:
        waited_for = client.post("/subdivide", content=b"full 100000", headers=GLB)
        assert waited_for.status_code == 503
        assert waited_for.json()["code"] == "no-storage"
        before = descriptors()
        job = started(client, b"full 100000")
        failed = ended(client, job)
        assert failed["state"] == "failed"
        assert failed["problem"]["code"] == "no-storage"
        refused = client.get(f"/jobs/{job}/result")
        assert (refused.status_code, refused.json()["code"]) == (503, "no-storage")
        # Its files are gone before anybody fetches or deletes it.
        until(lambda: descriptors() <= before)
        fine = started(client, b"large 100000")
        assert ended(client, fine)["state"] == "done"


def test_jobs_that_were_cancelled_hold_nothing_and_are_no_more_than_results_may_be(
    tmp_path: Path,
) -> None:
    """Each is there for fifteen minutes: had each a descriptor, a thousand would close the door."""
    with served(workers=1, results=5) as where, opened(where) as client:
        client.post("/subdivide", content=b"echo", headers=GLB)
        before = descriptors()
        jobs = []
        for _ in range(8):
            jobs.append(started(client, f"steps {tmp_path}".encode()))
            client.delete(f"/jobs/{jobs[-1]}")
        until(lambda: descriptors() <= before)
        known = [client.get(f"/jobs/{job}").status_code for job in jobs]
        assert known == [404] * 3 + [200] * 5


def descriptors() -> int:
    """Return how many memory files and deleted files this process holds."""
    return sum("(deleted)" in path for path in held())


def kept_in(folder: Path) -> list[str]:
    """The files of a folder that this process holds."""
    return [path for path in held() if path.startswith(str(folder))]


def held() -> list[str]:
    """Return the descriptors that this process has open."""
    paths = []
    for link in Path("/proc/self/fd").iterdir():
        # The server, which is in this process, may have closed it meanwhile.
        with suppress(FileNotFoundError):
            paths.append(str(link.readlink()))
    return paths


def test_a_client_over_its_budget_of_faces_is_429() -> None:
    # A job of the stand-ins has four faces.
    with served(workers=1, faces_per_minute=6) as where, opened(where) as client:
        assert client.post("/subdivide", content=b"echo", headers=GLB).status_code == 200
        for path in ("/subdivide", "/jobs"):
            refused = client.post(path, content=b"echo", headers=GLB)
            assert refused.status_code == 429
            assert refused.json()["code"] == "over-budget"
            assert 1 <= int(refused.headers["retry-after"]) <= 60


def test_a_short_job_passes_large_ones(tmp_path: Path) -> None:
    with served(workers=1, queue=4) as where, opened(where) as client:
        large = started(client, f"steps {tmp_path}".encode())
        until((tmp_path / "took-1").exists)
        waiting = started(client, b"echo")
        assert client.post("/subdivide", content=b"short", headers=GLB).content == b"short"
        assert state(client, large)["state"] == "running"
        assert state(client, waiting)["state"] == "queued"
        client.delete(f"/jobs/{large}")


def test_retry_after_is_the_predicted_backlog(tmp_path: Path) -> None:
    with served(workers=1, queue=4) as where, opened(where) as client:
        jobs = [started(client, f"steps {tmp_path}".encode()) for _ in range(4)]
        # Three quarters of the places are one client's.
        refused = hand_in(client, b"echo")
        assert refused.status_code == 503
        # Four jobs of a second each.
        assert int(refused.headers["retry-after"]) in (4, 5)
        for job in jobs:
            client.delete(f"/jobs/{job}")


def test_limits_are_told(client: httpx2.Client) -> None:
    limits = client.get("/limits").json()
    assert limits["body_bytes"] == 64 * 2**20
    assert limits["levels"] == {"min": 1, "max": 6}
    assert "model/gltf-binary" in limits["formats"]
    assert limits["faces"] == 5_000_000
