"""GET /models, and `model=` in a request: through the whole application and its workers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from pns_common.model.file import DEFAULT_MODEL, load_model
from service.http.app import create_app
from service.meshfiles.example import part_glb
from service.settings import Settings
from tests.support import stand_in_jobs as jobs
from tests.support.live import local
from tests.support.networks import DEFAULT_CARD
from tests.support.packages import several_models

GLB = {"Content-Type": "model/gltf-binary", "Accept": "application/json"}
REPORT = "/subdivide?diagnostics=none"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return several_models(tmp_path_factory.mktemp("package") / "models")


@contextmanager
def served(folder: Path, model: str | None = None) -> Iterator[TestClient]:
    warm_up = partial(jobs.hold_among, str(folder))
    with local(create_app(Settings(workers=1, model=model), warm_up=warm_up)) as client:
        yield client


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[TestClient]:
    with served(folder) as opened:
        yield opened


def subdivide(client: TestClient, query: str) -> httpx2.Response:
    return client.post(f"{REPORT}&{query}", content=part_glb(), headers=GLB)


def report(client: TestClient, query: str) -> dict[str, Any]:
    answer = subdivide(client, query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def assert_unknown(answer: httpx2.Response, names: list[str]) -> None:
    assert answer.status_code == 422
    document = answer.json()
    assert (document["code"], document["parameter"]) == ("invalid-parameter", "model")
    assert document["choices"] == names
    assert all(name in document["detail"] for name in names)


def test_a_request_picks_its_model_by_name(client: TestClient) -> None:
    paper = report(client, "model=paper")
    assert (paper["model"], paper["model_hash"]) == ("paper", load_model("paper").hash)
    assert paper["budget"] == load_model("paper").card.budget
    both = report(client, "model=vertices")
    assert both["model"] == "vertices"
    assert both["budget"] == DEFAULT_CARD.budget
    assert both["levels"][0]["vertex_rule"]["proximity_ratio"]["max"] > 0.01
    assert report(client, "")["model"] == DEFAULT_MODEL
    assert report(client, "model=") == report(client, f"model={DEFAULT_MODEL}")


@pytest.mark.parametrize("name", ["pape", "Paper", "./paper", "paper.onnx", "/etc/passwd", "../x"])
@pytest.mark.parametrize("scheme", ["pns", "loop"])
def test_422_for_what_is_no_models_name(client: TestClient, name: str, scheme: str) -> None:
    answer = subdivide(client, f"model={name}&scheme={scheme}")
    assert_unknown(answer, sorted({"broken", "paper", "vertices", DEFAULT_MODEL}))


def test_loop_needs_no_model_and_takes_a_name_as_it_takes_a_budget(client: TestClient) -> None:
    plain = report(client, "scheme=loop")
    assert report(client, "scheme=loop&model=vertices&budget=0.5") == plain
    assert plain["model"] is plain["budget"] is None
    # Not even loaded.
    assert report(client, "scheme=loop&model=broken") == plain


def test_503_for_a_bundled_model_that_does_not_load_and_for_it_alone(client: TestClient) -> None:
    answer = subdivide(client, "model=broken")
    assert answer.status_code == 503
    assert answer.json()["code"] == "no-model"
    assert "broken" in answer.json()["detail"]
    assert report(client, "model=paper")["model"] == "paper"
    assert client.get("/readyz").status_code == 200


def test_models_are_listed_with_their_cards(client: TestClient) -> None:
    answer = client.get("/models")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "application/json"
    entries = {entry["name"]: entry for entry in answer.json()}
    # One that does not load has nothing to say of itself.
    assert set(entries) == {"paper", "vertices", DEFAULT_MODEL}
    assert [name for name, entry in entries.items() if entry["default"]] == [DEFAULT_MODEL]
    assert entries["vertices"]["features"] == "directed-28"
    for name, entry in entries.items():
        assert report(client, f"model={name}")["model_hash"] == entry["hash"]
    properties = client.get("/openapi.json").json()["components"]["schemas"]["ModelEntry"]
    assert set(properties["properties"]) == set(entries["paper"])


def test_the_list_is_kept_by_clients_and_asked_for_again_at_no_cost(client: TestClient) -> None:
    answer = client.get("/models")
    tag = answer.headers["etag"]
    assert answer.headers["cache-control"] == "no-cache"
    assert client.get("/models").content == answer.content
    again = client.get("/models", headers={"If-None-Match": tag})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == tag
    assert client.get("/models", headers={"If-None-Match": '"other"'}).status_code == 200


def test_the_log_names_the_model(client: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="pns.service"):
        report(client, "model=vertices")
        report(client, "scheme=loop")
    assert "auto (vertices) levels=2" in caplog.text
    assert "loop levels=2" in caplog.text


def test_503_for_the_list_while_no_worker_can_read_it() -> None:
    settings = Settings(workers=1, queue=0, job_seconds=1)
    app = create_app(settings, warm_up=partial(jobs.stay_away, 60.0))
    with local(app) as client:
        began = time.monotonic()
        answer = client.get("/models")
        assert (answer.status_code, answer.json()["code"]) == (503, "busy")
        assert subdivide(client, "model=paper").status_code == 503
        assert time.monotonic() - began < 10
