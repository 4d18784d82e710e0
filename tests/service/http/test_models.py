"""Models by name: in GET /models, in a request's `model=`, and in a worker."""

import json
import time
from dataclasses import asdict
from functools import partial

import pytest

from pns_common.model import file as model_file
from pns_common.model.file import DEFAULT_MODEL, load_model
from service.errors import NoModelError
from service.http.app import create_app
from service.meshfiles.example import part_glb
from service.settings import Settings
from service.workers.models import Models, catalogue_of
from tests.support import stand_in_jobs as jobs
from tests.support.live import GLB, local
from tests.support.networks import DEFAULT_CARD
from tests.support.packages import served_file, several_models
from tests.support.stand_in_models import ZeroModel

NAMES = sorted({"broken", "paper", "vertices", DEFAULT_MODEL})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return several_models(tmp_path_factory.mktemp("package") / "models")


# Through the whole application and its workers


@pytest.fixture(scope="module")
def client(folder):
    warm_up = partial(jobs.hold_among, str(folder))
    with local(create_app(Settings(workers=1), warm_up=warm_up)) as opened:
        yield opened


def asked(client, query):
    return client.post(f"/report?diagnostics=none&{query}", content=part_glb(), headers=GLB)


def report(client, query):
    answer = asked(client, query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_request_picks_its_model_by_name(client, caplog):
    with caplog.at_level("INFO", logger="pns.service"):
        paper, both = report(client, "model=paper"), report(client, "model=vertices")
    assert (paper["model"], paper["model_hash"]) == ("paper", load_model("paper").hash)
    assert paper["budget"] == load_model("paper").card.budget
    assert (both["model"], both["budget"]) == ("vertices", DEFAULT_CARD.budget)
    assert both["levels"][0]["vertex_rule"]["proximity_ratio"]["max"] > 0.01
    assert "auto (vertices) levels=2" in caplog.text
    assert report(client, "")["model"] == DEFAULT_MODEL
    assert report(client, "model=") == report(client, f"model={DEFAULT_MODEL}")


@pytest.mark.parametrize("name", ["pape", "Paper", "./paper", "paper.onnx", "/etc/passwd", "../x"])
@pytest.mark.parametrize("scheme", ["pns", "loop"])
def test_422_for_what_is_no_models_name(client, name, scheme):
    answer = asked(client, f"model={name}&scheme={scheme}")
    document = answer.json()
    assert answer.status_code == 422
    assert (document["code"], document["parameter"]) == ("invalid-parameter", "model")
    assert document["choices"] == NAMES
    assert all(known in document["detail"] for known in NAMES)


def test_loop_needs_no_model_and_takes_a_name_as_it_takes_a_budget(client, caplog):
    with caplog.at_level("INFO", logger="pns.service"):
        plain = report(client, "scheme=loop")
    assert "loop levels=2" in caplog.text
    assert report(client, "scheme=loop&model=vertices&budget=0.5") == plain
    assert plain["model"] is plain["budget"] is None
    # Not even loaded.
    assert report(client, "scheme=loop&model=broken") == plain


def test_503_for_a_bundled_model_that_does_not_load_and_for_it_alone(client):
    answer = asked(client, "model=broken")
    assert (answer.status_code, answer.json()["code"]) == (503, "no-model")
    assert "broken" in answer.json()["detail"]
    assert report(client, "model=paper")["model"] == "paper"
    assert client.get("/readyz").status_code == 200


def test_models_are_listed_with_what_their_files_say(client, folder):
    answer = client.get("/models")
    assert answer.headers["content-type"] == "application/json"
    entries = {entry["name"]: entry for entry in answer.json()}
    # One that does not load has nothing to say of itself.
    assert list(entries) == [name for name in NAMES if name != "broken"]
    assert [name for name, entry in entries.items() if entry["default"]] == [DEFAULT_MODEL]
    for name, entry in entries.items():
        model = load_model(str(folder / f"{name}.onnx"))
        assert (entry["hash"], entry["size"]) == (model.hash, model.size)
        assert asdict(model.card).items() <= entry.items()
        assert report(client, f"model={name}")["model_hash"] == model.hash
    properties = client.get("/openapi.json").json()["components"]["schemas"]["ModelEntry"]
    assert set(properties["properties"]) == set(entries["paper"])


def test_the_list_is_kept_by_clients_and_asked_for_again_at_no_cost(client):
    answer = client.get("/models")
    tag = answer.headers["etag"]
    assert answer.headers["cache-control"] == "no-cache"
    assert client.get("/models").content == answer.content
    again = client.get("/models", headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert client.get("/models", headers={"If-None-Match": '"other"'}).status_code == 200


def test_503_for_the_list_while_no_worker_can_read_it():
    settings = Settings(workers=1, queue=0, job_seconds=1)
    app = create_app(settings, warm_up=partial(jobs.stay_away, 60.0))
    with local(app) as client:
        began = time.monotonic()
        answer = client.get("/models")
        assert (answer.status_code, answer.json()["code"]) == (503, "busy")
        assert asked(client, "model=paper").status_code == 503
        assert time.monotonic() - began < 10


# In a worker


@pytest.fixture
def serving(folder, monkeypatch):
    """The models of a worker, by what it is to serve, and on which providers."""
    monkeypatch.setattr(model_file, "BUNDLED", folder)

    def hold(*served):
        models = Models()
        models.hold(*served)
        return models

    return hold


def entries_of(models):
    listed = json.loads(catalogue_of(models).content)
    return {(entry["name"], entry["default"]): entry for entry in listed}


def test_without_a_name_the_served_one_runs_and_every_bundled_one_by_name(serving, tmp_path):
    mine, zero = served_file(tmp_path / "mine.onnx"), ZeroModel()
    sources = (None, DEFAULT_MODEL), ("vertices", "vertices"), (mine, "mine"), (zero, "zero")
    for source, name in sources:
        models = serving(source)
        assert models.get().name == name
        assert models.get(name) is models.get()
        assert models.get("paper").hash == load_model("paper").hash
        assert [listed for listed, default in entries_of(models) if default] == [name]
    # Without a file it has no size.
    entry = entries_of(models)["zero", True]
    assert entry.items() >= (asdict(zero.card) | {"size": None}).items()


def test_a_bundled_name_wins_over_that_of_the_served_file(serving, tmp_path):
    models = serving(served_file(tmp_path / "paper.onnx"))
    assert models.get("paper").hash == load_model("paper").hash != models.get().hash
    listed = entries_of(models)
    assert listed["paper", False]["hash"] == load_model("paper").hash
    assert listed["paper", True]["hash"] == models.get().hash


def test_what_is_served_says_what_is_missing_when_it_is_loaded(serving, tmp_path, caplog):
    """Polygons are left to the classic rule; a file that does not load has a name and no entry."""
    catalogue_of(serving(None))
    assert "companion" not in caplog.text
    catalogue_of(serving(served_file(tmp_path / "mine.onnx")))
    assert "model mine has no companion for polygons" in caplog.text
    missing = serving("missing.onnx")
    assert not any(default for _, default in entries_of(missing))
    assert "missing" in catalogue_of(missing).names


def test_every_model_runs_on_the_providers_that_are_set(serving):
    entries = entries_of(serving(None, ("CPUExecutionProvider",)))
    assert all(entry["providers"] == ["CPUExecutionProvider"] for entry in entries.values())
    with pytest.raises(NoModelError, match=r"SpareExecutionProvider.*CPUExecutionProvider"):
        serving(None, ("SpareExecutionProvider",)).get()
