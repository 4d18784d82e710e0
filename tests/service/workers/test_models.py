"""Models of a worker, by name, and their lines in the catalogue."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from pns_common.model import file as model_file
from pns_common.model.card import ModelCard
from pns_common.model.file import DEFAULT_MODEL, load_model
from service.errors import NoModelError
from service.workers.models import Models, catalogue_of
from tests.support.packages import served_file, several_models
from tests.support.stand_in_models import ZeroModel

NAMES = sorted({"broken", "paper", "vertices", DEFAULT_MODEL})


@pytest.fixture(autouse=True)
def several(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(model_file, "BUNDLED", several_models(tmp_path / "models"))


def serving(source: ZeroModel | str | None) -> Models:
    models = Models()
    models.hold(source)
    return models


def entries(models: Models) -> dict[tuple[str, bool], dict[str, object]]:
    listed = json.loads(catalogue_of(models).content)
    return {(entry["name"], entry["default"]): entry for entry in listed}


def test_without_a_name_the_served_one_runs_and_every_bundled_one_by_name(tmp_path: Path) -> None:
    mine = served_file(tmp_path / "mine.onnx")
    for source, name in ((None, DEFAULT_MODEL), ("vertices", "vertices"), (mine, "mine")):
        models = serving(source)
        assert models.get().name == name
        assert models.get(name) is models.get()
        assert models.get("paper").hash == load_model("paper").hash
    assert serving(ZeroModel()).get("zero") == ZeroModel()


def test_a_bundled_name_wins_over_that_of_the_served_file(tmp_path: Path) -> None:
    models = serving(served_file(tmp_path / "paper.onnx"))
    assert models.get("paper").hash == load_model("paper").hash != models.get().hash
    listed = entries(models)
    assert listed["paper", False]["hash"] == load_model("paper").hash
    assert listed["paper", True]["hash"] == models.get().hash


def test_the_catalogue_says_what_the_files_say() -> None:
    models = serving(None)
    listed = entries(models)
    assert [name for name, _ in listed] == [name for name in NAMES if name != "broken"]
    assert catalogue_of(models).names == tuple(NAMES)
    assert [name for name, default in listed if default] == [DEFAULT_MODEL]
    for entry in listed.values():
        model = load_model(str(entry["name"]))
        assert (entry["hash"], entry["size"]) == (model.hash, model.size)
        card = {name: entry[name] for name in ModelCard.__dataclass_fields__}
        assert ModelCard(**card) == model.card


def test_a_served_file_is_the_default_and_one_that_does_not_load_is_not_listed(
    tmp_path: Path,
) -> None:
    listed = entries(serving(served_file(tmp_path / "mine.onnx")))
    assert [name for name, default in listed if default] == ["mine"]
    missing = serving("missing.onnx")
    assert not any(default for _, default in entries(missing))
    assert "missing" in catalogue_of(missing).names


def test_a_model_that_leaves_polygons_to_the_classic_rule_says_so_when_it_is_loaded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    catalogue_of(serving(None))
    assert "companion" not in caplog.text
    catalogue_of(serving(served_file(tmp_path / "mine.onnx")))
    assert "model mine has no companion for polygons" in caplog.text


def test_every_model_runs_on_the_providers_that_are_set() -> None:
    models = Models()
    models.hold(None, ("CPUExecutionProvider",))
    assert all(entry["providers"] == ["CPUExecutionProvider"] for entry in entries(models).values())


def test_a_provider_that_is_not_there_is_named_with_those_that_are() -> None:
    models = Models()
    models.hold(None, ("SpareExecutionProvider",))
    with pytest.raises(NoModelError, match=r"SpareExecutionProvider.*CPUExecutionProvider"):
        models.get()


def test_a_model_without_a_file_has_no_size() -> None:
    entry = entries(serving(ZeroModel()))["zero", True]
    assert entry["size"] is None
    assert asdict(ZeroModel().card).items() <= entry.items()
