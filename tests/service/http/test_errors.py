"""Every status of the service, each as a problem document, through the whole application."""

from __future__ import annotations

from collections.abc import Iterator

import httpx2
import pytest
from fastapi.testclient import TestClient

from tests.support.live import GLB, obeying, until


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with obeying(queue=1, body=2**20, levels=5) as opened:
        wait_until_ready(opened)
        yield opened


def wait_until_ready(client: TestClient) -> None:
    """Jobs may take two seconds here, and on a busy machine a worker takes longer to start."""
    until(lambda: client.get("/readyz").status_code == 200)


def post(client: TestClient, body: bytes, query: str = "", **headers: str) -> httpx2.Response:
    return client.post(f"/subdivide?{query}", content=body, headers=GLB | headers)


def assert_problem(answer: httpx2.Response, status: int, code: str) -> dict[str, object]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document = answer.json()
    assert document["status"] == status
    assert document["code"] == code
    assert document["type"] == f"urn:pns:problem:{code}"
    assert document["title"]
    assert document["detail"]
    assert "Traceback" not in answer.text
    return document


def test_200_carries_the_answer_and_its_stages(client: TestClient) -> None:
    answer = post(client, b"echo this")
    assert answer.status_code == 200
    assert answer.content == b"echo this"
    assert answer.headers["content-type"] == "model/gltf-binary"
    assert answer.headers["vary"] == "Accept"
    stages = [entry.partition(";")[0] for entry in answer.headers["server-timing"].split(", ")]
    assert stages == ["upload", "queue", "read", "refine", "total"]


LENGTH = "reference_length: it must be 'auto' or a finite number > 0"
PARAMETERS = [
    *(("levels", f"levels={value}", "") for value in ("0", "7", "1.5", "many", "nan")),
    *(("budget", f"budget={value}", "") for value in ("nan", "inf", "-1")),
    *(("reference_length", f"reference_length={value}", LENGTH) for value in ("0", "-inf", "nan")),
    *(("reference_length", f"reference_length={value}", LENGTH) for value in ("Auto", "many")),
    ("scheme", "scheme=butterfly", ""),
    ("diagnostics", "diagnostics=all", ""),
    ("level", "level=2", "level: there is no such parameter; is it levels?"),
    ("x", "x=2", "x: there is no such parameter"),
    ("levels", "levels=1&levels=2", "levels is given 2 times"),
    ("scheme", "scheme=loop&levels=3&scheme=loop", "scheme is given 2 times"),
]


@pytest.mark.parametrize(("name", "query", "detail"), PARAMETERS)
def test_422_names_the_bad_parameter(
    client: TestClient, name: str, query: str, detail: str
) -> None:
    document = assert_problem(post(client, b"x", query), 422, "invalid-parameter")
    assert document["parameter"] == name
    assert document["detail"] == (detail or document["detail"])


LIMIT = "limit-exceeded"
REFUSALS = [
    (b"unreadable", "", 400, "unreadable", {}),
    (b"broken", "", 422, "invalid-gltf", {"pointer": "/accessors/3/count"}),
    (b"faces", "", 413, LIMIT, {"limit": "faces", "allowed": 5, "found": 20}),
    (b"x", "levels=6", 413, LIMIT, {"limit": "levels"}),
]


@pytest.mark.parametrize(("body", "query", "status", "code", "members"), REFUSALS)
def test_a_refusal_says_what_is_wrong_and_where(
    client: TestClient, body: bytes, query: str, status: int, code: str, members: dict[str, object]
) -> None:
    document = assert_problem(post(client, body, query), status, code)
    assert members.items() <= document.items()


NOT_TAKEN = 415, "unsupported-media-type"


@pytest.mark.parametrize(
    ("name", "value", "status", "code"),
    [
        *(("Content-Type", kind, *NOT_TAKEN) for kind in ("image/png", "a/x-binary", "", "model")),
        ("Content-Encoding", "br", *NOT_TAKEN),
        ("Content-Length", "many", 400, "unreadable"),
    ],
)
def test_a_head_that_cannot_be_taken_is_refused(
    client: TestClient, name: str, value: str, status: int, code: str
) -> None:
    assert_problem(post(client, b"x", **{name: value}), status, code)


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("application/json", "application/json"),
        ("APPLICATION/JSON; charset=utf-8", "application/json"),
        ("application/json, model/gltf-binary;q=0.5", "application/json"),
        ("application/json, */*;q=0.1", "application/json"),
        ("application/*, model/gltf-binary;q=0", "application/json"),
        ("application/json;q=0.5, model/gltf-binary", "model/gltf-binary"),
        ("application/json;q=0.5, model/*;q=0.6", "model/gltf-binary"),
        ("application/json;q=0", "model/gltf-binary"),
        ("application/json, model/gltf-binary", "model/gltf-binary"),
        ("*/*", "model/gltf-binary"),
        ("image/png", "model/gltf-binary"),
        ("application/octet-stream", "application/octet-stream"),
        ("application/octet-stream;q=0.5, model/*", "model/gltf-binary"),
    ],
)
def test_the_answer_is_what_is_wanted_most(client: TestClient, accept: str, kind: str) -> None:
    assert post(client, b"{}", Accept=accept).headers["content-type"] == kind
    lines = [*GLB.items(), ("Accept", "text/html"), ("Accept", accept)]
    on_two = client.post("/subdivide", content=b"{}", headers=lines)
    assert on_two.headers["content-type"] == kind
    reported = client.post("/report", content=b"{}", headers=GLB | {"Accept": accept})
    assert reported.headers["content-type"] == "application/json"


def test_a_body_is_taken_up_to_the_limit_whole_or_in_chunks(client: TestClient) -> None:
    for content in (bytes(2**20), (bytes(2**16) for _ in range(16))):
        answer = client.post("/subdivide", content=content, headers=GLB)
        assert len(answer.content) == 2**20
    beyond = client.post("/subdivide", content=(bytes(2**16) for _ in range(17)), headers=GLB)
    document = assert_problem(beyond, 413, LIMIT)
    assert (document["limit"], document["allowed"]) == ("body", 2**20)


@pytest.mark.parametrize("path", ["/docs/none/", "/models/", "/subdivide/"])
def test_a_slash_too_many_leads_nowhere(client: TestClient, path: str) -> None:
    answer = client.get(path, headers={"Host": "elsewhere.localhost"}, follow_redirects=False)
    assert_problem(answer, 404, "not-found")
    assert "location" not in answer.headers


def test_404_and_405_are_problems_too(client: TestClient) -> None:
    nothing = assert_problem(client.get("/nothing"), 404, "not-found")
    assert nothing["detail"] == "there is nothing at this path; /docs shows what there is"
    for method, path, allowed in (
        ("GET", "/subdivide", "POST"),
        ("PUT", "/report", "POST"),
        ("PUT", "/limits", "GET"),
        ("PUT", "/", "GET"),
    ):
        wrong = client.request(method, path)
        document = assert_problem(wrong, 405, "method-not-allowed")
        assert document["detail"] == f"this path takes {allowed}"
        assert wrong.headers["allow"] == allowed
    assert client.head("/subdivide").status_code == 405


@pytest.mark.parametrize("body", [b"fault", b"unpicklable"])
def test_500_keeps_our_faults_in_the_log(
    client: TestClient, body: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    answer = post(client, body)
    assert_problem(answer, 500, "internal-error")
    assert "secret" not in answer.text
    assert "raise" in caplog.text


def test_503_for_a_job_that_ends_two_workers_and_the_next_request_is_served(
    client: TestClient,
) -> None:
    answer = post(client, b"die")
    assert_problem(answer, 503, "worker-died")
    assert int(answer.headers["retry-after"]) >= 1
    wait_until_ready(client)
    assert post(client, b"again").status_code == 200


def test_413_for_a_job_that_takes_more_than_was_predicted(client: TestClient) -> None:
    worker = post(client, b"pid").content
    document = assert_problem(post(client, b"memory 1000000"), 413, "limit-exceeded")
    assert (document["limit"], document["allowed"]) == ("memory", 1_000_000)
    assert post(client, b"pid").content == worker


def test_504_for_a_job_past_its_time() -> None:
    with obeying(job_seconds=2) as client:
        # A worker that still starts leaves a job no time.
        wait_until_ready(client)
        assert_problem(post(client, b"sleep 30"), 504, "job-timeout")
        wait_until_ready(client)
        assert client.get("/readyz").json() == {"status": "ready"}
        assert client.get("/healthz").json() == {"status": "ok"}
