"""The bundled file is what its recipe makes, and reaches what its card says."""

import json

import pytest
from typer.testing import CliRunner

import export.run
from export.model_file import checkpoint_card
from export.run import BUNDLED
from pns_common import load_model, pns
from train.checkpoint import Checkpoint, save_checkpoint
from train.datasets import ridge_held_out
from train.determinism import machine_fingerprint
from train.evaluation import compare_with_loop
from train.metrics import METRICS, improvements_as_data
from train.recipe_operator import initial_network
from train.recipes import RECIPES, ridge
from train.torch_model import recipe_model
from train.trainer import fit

PERCENT_POINTS = 0.01


@pytest.fixture(scope="module")
def bundled():
    return load_model(BUNDLED)


def test_card_holds_what_a_fresh_evaluation_finds(bundled):
    found = compare_with_loop(pns(bundled), ridge_held_out())
    card = bundled.card.metrics["ridge-held-out"]
    assert set(card) == set(METRICS)
    for metric, row in improvements_as_data(found).items():
        for name, value in row.items():
            tolerance = PERCENT_POINTS if name in ("percent", "low", "high") else 2e-6
            assert value == pytest.approx(card[metric][name], abs=tolerance), (metric, name)


def test_bundled_model_reaches_the_goals(bundled):
    card = bundled.card.metrics["ridge-held-out"]
    assert (bundled.card.budget, bundled.card.gate_sharpness) == (0.5, 10.0)
    assert card["distance_near"]["percent"] >= 20
    assert card["distance"]["percent"] >= 12


def test_recipe_makes_the_bundled_file_again(bundled, tmp_path):
    training = bundled.card.training
    recipe = RECIPES[training["recipe"]](training["seed"])
    network = fit(recipe, lambda done, loss: None).network
    held_out = compare_with_loop(pns(recipe_model(recipe, network)), ridge_held_out())
    if training["machine"] != machine_fingerprint():
        # Another processor or library rounds otherwise: the same quality is all that can be asked.
        for metric, row in bundled.card.metrics["ridge-held-out"].items():
            assert held_out[metric].percent == pytest.approx(row["percent"], abs=1.0), metric
        return
    metrics = {"ridge-held-out": improvements_as_data(held_out)}
    path = tmp_path / "ridge.safetensors"
    save_checkpoint(path, Checkpoint(recipe, network, metrics, machine_fingerprint()))
    assert export_command(path, tmp_path / "made.onnx").exit_code == 0
    assert (tmp_path / "made.onnx").read_bytes() == BUNDLED.read_bytes()


def test_card_holds_the_recipe_as_it_stands(bundled):
    training = bundled.card.training
    recipe = RECIPES[training["recipe"]](training["seed"])
    checkpoint = Checkpoint(recipe, initial_network(recipe), {}, training["machine"])
    assert as_json(checkpoint_card(checkpoint).training) == as_json(training)


def test_export_command_writes_the_same_bytes_twice(tmp_path):
    path = tmp_path / "c.safetensors"
    save_checkpoint(path, Checkpoint(ridge(), initial_network(ridge()), {}, "machine"))
    for name in ("one.onnx", "two.onnx"):
        outcome = export_command(path, tmp_path / name)
        assert outcome.exit_code == 0
        assert "parity" in outcome.output
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()


def test_export_command_refuses_what_is_no_checkpoint(tmp_path):
    (tmp_path / "bad").write_text("{}")
    outcome = export_command(tmp_path / "bad", tmp_path / "m.onnx")
    assert outcome.exit_code == 1
    assert "expected safetensors" in outcome.output
    assert not (tmp_path / "m.onnx").exists()


def export_command(checkpoint, output):
    arguments = ["--checkpoint", str(checkpoint), "--output", str(output)]
    return CliRunner().invoke(export.run.app, arguments, catch_exceptions=False)


def as_json(data):
    return json.loads(json.dumps(data))
