"""An exported file says what the network says, and keeps its symmetry."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from typer.testing import CliRunner

import export.run
from export.directed_graph import directed_bytes
from export.model_file import export_model, write_model
from export.onnx_graph import OPSET, model_bytes
from export.parity import BUDGETS, TOLERANCE, ParityError, check_directed, check_parity
from pns_common import ModelError
from pns_common.model.file import ALLOWED_OPERATORS, BUNDLED, load_model, model_from_bytes
from tests.support.directed import random_network
from tests.support.networks import CARD, DEFAULT_CARD
from train.metrics.card import TO_LIMIT
from train.metrics.one_step import Improvement
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.from_recipe import initial_directed, initial_network
from train.models.networks import BoundedNet
from train.models.recipes import general, general_quad, paper, signed


def dense(activation="gelu", scale=1.0, seed=0):
    """An untrained network; with a large last layer the projection is at work."""
    network = BoundedNet(5, (16, 16), activation, torch.Generator().manual_seed(seed))
    with torch.no_grad():
        network.linear_layers[-1].weight *= scale
    return network


@pytest.mark.parametrize("activation", ["gelu", "silu", "tanh"])
@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_a_file_says_what_the_network_says(activation, scale):
    network = dense(activation, scale)
    parity = check_parity(model_from_bytes(model_bytes(network, CARD), "test"), network)
    assert parity.difference <= TOLERANCE
    assert parity.length <= 1 + TOLERANCE
    if scale > 1:
        assert parity.length > 1 - TOLERANCE


@pytest.mark.parametrize("base", ["loop", "catmull-clark"])
def test_a_file_of_directed_edges_says_what_each_network_says(base):
    network = random_network(0, faces=base != "loop").float()
    model = model_from_bytes(directed_bytes(network, replace(DEFAULT_CARD, base=base)), "directed")
    assert check_directed(model, network).difference <= TOLERANCE
    with torch.no_grad():
        network.heads.parametrizations.bias.original += 1e-3
    with pytest.raises(ParityError):
        check_directed(model, network)


@pytest.mark.parametrize(
    "made",
    [lambda: model_bytes(dense(), CARD), lambda: directed_bytes(random_network(0), DEFAULT_CARD)],
    ids=["1", "5"],
)
def test_the_same_networks_give_the_same_bytes_and_nothing_of_this_machine(made):
    assert made() == made()
    proto = onnx.load_from_string(made())
    assert [(entry.domain, entry.version) for entry in proto.opset_import] == [("", OPSET)]
    assert {node.op_type for node in proto.graph.node} <= ALLOWED_OPERATORS
    assert not proto.producer_version + proto.doc_string
    assert not any(node.doc_string for node in proto.graph.node)


@pytest.mark.parametrize("version", [2, 4])
def test_no_file_of_a_retired_format_is_written(tmp_path, version):
    path = tmp_path / "old.onnx"
    with pytest.raises(ModelError, match=f"format {version}, which is not read any more"):
        write_model(dense(), replace(CARD, format=version), path)
    assert not path.exists()


@pytest.mark.parametrize("damage", [1e-5, float("nan")])
def test_a_file_that_differs_is_not_written(tmp_path, monkeypatch, damage):
    network, other = dense(), dense()
    with torch.no_grad():
        other.linear_layers[-1].bias += damage
    path = tmp_path / "model.onnx"
    path.write_bytes(b"the old file")
    monkeypatch.setattr("export.model_file.model_bytes", lambda _, card: model_bytes(other, card))
    with pytest.raises((ParityError, ModelError)) as caught:
        write_model(network, CARD, path)
    if isinstance(caught.value, ParityError):
        assert caught.value.budget in BUDGETS
        assert caught.value.difference > TOLERANCE
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.onnx"]
    assert path.read_bytes() == b"the old file"


@pytest.mark.parametrize(
    "recipe", [paper(4), signed(4), general(4), general_quad(4)], ids=lambda recipe: recipe.name
)
def test_a_card_holds_the_whole_recipe(tmp_path, recipe):
    metrics = {"ridge-held-out": {"distance": {"percent": 12.0}}}
    form = recipe.directed
    network = (initial_network if form is None else initial_directed)(recipe)
    save_checkpoint(tmp_path / "made", Checkpoint(recipe, network, metrics, "machine"))
    checkpoint = load_checkpoint(tmp_path / "made")
    exported = export_model(checkpoint, tmp_path / "models" / "mine.onnx")
    model = load_model(tmp_path / "models" / "mine.onnx")
    assert model.hash == exported.sha256
    card = model.card
    for name in ("features", "gate_sharpness", "budget", "orientation"):
        assert getattr(card, name) == getattr(recipe, name)
    for name in ("seed", "steps", "learning_rate", "activation"):
        assert card.training[name] == getattr(recipe, name)
    assert card.metrics == metrics
    assert card.training["machine"] == "machine"
    assert card.format == (1 if form is None else 5)
    if form is not None:
        names = ("base", "width", "hidden", "rounds", "network_scale", "fold_angle")
        names += ("sharpness_levels",)
        assert all(getattr(card, name) == getattr(form, name) for name in names)
        assert card.boundary_strength == form.curve_strength


def test_the_command_runs_from_a_checkout_that_is_not_installed(tmp_path):
    """`python export/run.py` puts its own folder first on the path, not the checkout."""
    root = Path(__file__).resolve().parents[2]
    save_checkpoint(
        tmp_path / "c.safetensors", Checkpoint(paper(), initial_network(paper()), {}, "machine")
    )
    code = (
        "import runpy, sys; root = sys.argv.pop(1);"
        "sys.path[:] = [f'{root}/export', *(p for p in sys.path[1:] if p not in ('', root))];"
        "runpy.run_path(f'{root}/export/run.py', run_name='__main__')"
    )
    arguments = ["--checkpoint", tmp_path / "c.safetensors", "--output", tmp_path / "c.onnx"]
    done = subprocess.run(
        [sys.executable, "-c", code, root, *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "parity" in done.stdout
    assert load_model(tmp_path / "c.onnx").card.format == 1


def test_a_bundled_model_is_measured_anew_and_keeps_its_networks(tmp_path, monkeypatch):
    path = tmp_path / "general.onnx"
    path.write_bytes((BUNDLED / "general.onnx").read_bytes())
    row = Improvement(reference_mean=2.0, method_mean=1.0, percent=50.0, low=40.0, high=60.0)
    measures = dict.fromkeys(TO_LIMIT, lambda scheme: {"distance": row})
    monkeypatch.setattr("export.measure.MEASURES", measures)
    monkeypatch.setattr("export.run.MODELS", tmp_path)
    command = ["--measure", "general"]
    outcome = CliRunner().invoke(export.run.app, command, catch_exceptions=False)
    assert outcome.exit_code == 0
    before, after = load_model("general"), load_model(path)
    assert {name: rows["distance"]["percent"] for name, rows in after.card.metrics.items()} == (
        dict.fromkeys(TO_LIMIT, 50.0)
    )
    assert replace(after.card, metrics={}) == replace(before.card, metrics={})
    rows = np.random.default_rng(0).standard_normal((50, 28))
    np.testing.assert_array_equal(after.run("features", rows), before.run("features", rows))
    assert (tmp_path / "SHA256SUMS").read_text() == f"{after.hash}  general.onnx\n"
    refused = CliRunner().invoke(export.run.app, ["--measure", "nothing"])
    assert refused.exit_code == 1
    assert "expected a model file" in refused.output
