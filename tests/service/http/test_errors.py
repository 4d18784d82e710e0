"""Every status of the service, each as a problem document, through the whole application."""

import pytest

from tests.support.live import GLB, obeying, until


@pytest.fixture(scope="module")
def client():
    with obeying(queue=1, body=2**20, levels=5) as opened:
        wait_until_ready(opened)
        yield opened


def wait_until_ready(client):
    """Jobs may take two seconds here, and on a busy machine a worker takes longer to start."""
    until(lambda: client.get("/readyz").status_code == 200)


def post(client, body, query="", **headers):
    return client.post(f"/subdivide?{query}", content=body, headers=GLB | headers)


def assert_problem(answer, status, code, **members):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document = answer.json()
    said = {"status": status, "code": code, "type": f"urn:pns:problem:{code}", **members}
    assert said.items() <= document.items()
    assert document["title"]
    assert document["detail"]
    assert "Traceback" not in answer.text
    return document


def test_200_carries_the_answer_and_its_stages(client):
    answer = post(client, b"echo this")
    assert (answer.status_code, answer.content) == (200, b"echo this")
    assert answer.headers["content-type"] == "model/gltf-binary"
    assert answer.headers["vary"] == "Accept"
    stages = [entry.partition(";")[0] for entry in answer.headers["server-timing"].split(", ")]
    assert stages == ["upload", "queue", "read", "refine", "total"]


LENGTH = "reference_length: it must be 'auto' or a finite number > 0"


# The ranges themselves: tests/service/test_options.py.
@pytest.mark.parametrize(
    ("name", "query", "detail"),
    [
        *(("levels", f"levels={value}", None) for value in ("0", "7", "1.5", "nan")),
        *(("budget", f"budget={value}", None) for value in ("nan", "-1")),
        *(("reference_length", f"reference_length={value}", LENGTH) for value in ("0", "Auto")),
        ("scheme", "scheme=butterfly", None),
        ("level", "level=2", "level: there is no such parameter; is it levels?"),
        ("x", "x=2", "x: there is no such parameter"),
        ("scheme", "scheme=loop&levels=3&scheme=loop", "scheme is given 2 times"),
    ],
)
def test_422_names_the_bad_parameter(client, name, query, detail):
    found = assert_problem(post(client, b"x", query), 422, "invalid-parameter", parameter=name)
    assert detail in (None, found["detail"])


def test_a_refusal_says_what_is_wrong_and_where(client):
    limit = "limit-exceeded"
    assert_problem(post(client, b"unreadable"), 400, "unreadable")
    assert_problem(post(client, b"broken"), 422, "invalid-gltf", pointer="/accessors/3/count")
    assert_problem(post(client, b"faces"), 413, limit, limit="faces", allowed=5, found=20)
    assert_problem(post(client, b"x", "levels=6"), 413, limit, limit="levels")


TYPE, ENCODING = "Content-Type", "Content-Encoding"
NOT_TAKEN = 415, "unsupported-media-type"


@pytest.mark.parametrize(
    ("name", "value", "status", "code"),
    [
        *((TYPE, kind, *NOT_TAKEN) for kind in ("image/png", "a/x-binary", "", "model")),
        *((ENCODING, value, *NOT_TAKEN) for value in ("br", "deflate", "gzip, gzip", "x")),
        ("Content-Length", "many", 400, "unreadable"),
    ],
)
def test_a_head_that_cannot_be_taken_is_refused(client, name, value, status, code):
    assert_problem(post(client, b"x", **{name: value}), status, code)


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("application/json", "application/json"),
        ("APPLICATION/JSON; charset=utf-8", "application/json"),
        (" Application/JSON ; Q = 0.5 ", "application/json"),
        ("application/json, model/gltf-binary;q=0.5", "application/json"),
        ("application/json;v=1;q=0.3;q=0.9, model/gltf-binary;q=0.5", "model/gltf-binary"),
        ("application/json, */*;q=0.1", "application/json"),
        ("*/*;q=0.1, application/*;q=0.2", "application/json"),
        ("application/*, model/gltf-binary;q=0", "application/json"),
        ("application/json;q=0.5, model/gltf-binary", "model/gltf-binary"),
        ("application/json;q=0.5, application/json, model/gltf-binary;q=0.7", "application/json"),
        ("application/json;q=2, model/gltf-binary;q=0.9", "application/json"),
        ("application/json;q=0.5, model/*;q=0.6", "model/gltf-binary"),
        ("application/*, application/json;q=0", "application/octet-stream"),
        ("text/*, , application/jsonp", "model/gltf-binary"),
        ("application/json;q=0", "model/gltf-binary"),
        ("application/json, model/gltf-binary", "model/gltf-binary"),
        ("*/*", "model/gltf-binary"),
        ("image/png", "model/gltf-binary"),
        ("application/octet-stream", "application/octet-stream"),
        ("application/octet-stream;q=0.5, model/*", "model/gltf-binary"),
    ],
)
def test_the_answer_is_what_is_wanted_most(client, accept, kind):
    """The most specific range tells."""
    assert post(client, b"{}", Accept=accept).headers["content-type"] == kind
    lines = [*GLB.items(), ("Accept", "text/html"), ("Accept", accept)]
    on_two = client.post("/subdivide", content=b"{}", headers=lines)
    assert on_two.headers["content-type"] == kind
    reported = client.post("/report", content=b"{}", headers=GLB | {"Accept": accept})
    assert reported.headers["content-type"] == "application/json"


def test_a_body_is_taken_up_to_the_limit_whole_or_in_chunks(client):
    for content in (bytes(2**20), (bytes(2**16) for _ in range(16))):
        assert len(post(client, content).content) == 2**20
    beyond = post(client, (bytes(2**16) for _ in range(17)))
    assert_problem(beyond, 413, "limit-exceeded", limit="body", allowed=2**20)


def test_404_and_405_are_problems_too(client):
    detail = "there is nothing at this path; /docs shows what there is"
    assert_problem(client.get("/nothing"), 404, "not-found", detail=detail)
    for path in ("/docs/none/", "/models/", "/subdivide/"):
        answer = client.get(path, headers={"Host": "a.localhost"}, follow_redirects=False)
        assert_problem(answer, 404, "not-found")
        assert "location" not in answer.headers
    for method, path, allowed in (
        *(("GET", "/subdivide", "POST"), ("PUT", "/report", "POST")),
        *(("PUT", "/limits", "GET"), ("PUT", "/", "GET")),
    ):
        wrong = client.request(method, path)
        detail = f"this path takes {allowed}"
        assert_problem(wrong, 405, "method-not-allowed", detail=detail)
        assert wrong.headers["allow"] == allowed
    assert client.head("/subdivide").status_code == 405


@pytest.mark.parametrize("body", [b"fault", b"unpicklable"])
def test_500_keeps_our_faults_in_the_log(client, body, caplog):
    answer = post(client, body)
    assert_problem(answer, 500, "internal-error")
    assert "secret" not in answer.text
    assert "raise" in caplog.text


def test_503_for_a_job_that_ends_two_workers_and_the_next_request_is_served(client):
    answer = post(client, b"die")
    assert_problem(answer, 503, "worker-died")
    assert int(answer.headers["retry-after"]) >= 1
    wait_until_ready(client)
    assert post(client, b"again").status_code == 200


def test_413_for_a_job_that_takes_more_than_was_predicted(client):
    worker = post(client, b"pid").content
    answer = post(client, b"memory 1000000")
    assert_problem(answer, 413, "limit-exceeded", limit="memory", allowed=1_000_000)
    assert post(client, b"pid").content == worker


def test_504_for_a_job_past_its_time():
    with obeying(job_seconds=1) as client:
        # A worker that still starts leaves a job no time.
        wait_until_ready(client)
        assert_problem(post(client, b"sleep 30"), 504, "job-timeout")
        wait_until_ready(client)
        assert client.get("/readyz").json() == {"status": "ready"}
        assert client.get("/healthz").json() == {"status": "ok"}
