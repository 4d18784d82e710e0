"""An exported file says what the network says, and keeps its symmetry."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from typer.testing import CliRunner

import export.run
from export.model_file import export_model, write_model
from export.onnx_graph import OPSET, model_bytes
from export.parity import BUDGETS, TOLERANCE, ParityError, check_parity, check_sharpness
from pns_common import ModelError
from pns_common.model.features import FACE_FEATURE_SETS, FEATURE_SETS, RING_FEATURE_SETS
from pns_common.model.file import ALLOWED_OPERATORS, BUNDLED, load_model, model_from_bytes
from tests.support.networks import CARD, DEFAULT_CARD
from train.metrics.card import TO_LIMIT
from train.metrics.one_step import Improvement
from train.models.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from train.models.from_recipe import (
    initial_network,
    initial_networks,
    initial_sharpness_network,
    initial_vertex_network,
)
from train.models.networks import BoundedNet, SharpNet
from train.models.recipes import general, general_quad, paper
from train.models.tied import TiedNet

EDGES, VERTICES = FEATURE_SETS["signed-18"].symmetries, RING_FEATURE_SETS["ring-10"].symmetries
SINGLE = 2e-6


def dense(activation="gelu", scale=1.0, seed=0):
    """An untrained network; with a large last layer the projection is at work."""
    network = BoundedNet(5, (16, 16), activation, torch.Generator().manual_seed(seed))
    with torch.no_grad():
        network.linear_layers[-1].weight *= scale
    return network


def tied(group, copies, seed=0, scale=3.0):
    """A network with tied random weights."""
    network = TiedNet(group, copies, "silu", torch.Generator().manual_seed(seed))
    with torch.no_grad():
        last = network.linear_layers[-1]
        last.weight = torch.randn(last.weight.shape, generator=torch.Generator().manual_seed(seed))
        last.weight = last.weight * scale / last.weight.shape[1] ** 0.5
    return network


def two_networks():
    return tied(EDGES, (4, 4)), tied(VERTICES, (8, 8), seed=1)


def two_networks_bytes():
    edges, vertices = two_networks()
    return model_bytes(edges, DEFAULT_CARD, vertices)


def test_a_file_of_three_networks_says_what_each_says(tmp_path):
    edges, vertices = two_networks()
    sharp = SharpNet(53, (16,), "silu", torch.Generator().manual_seed(0))
    card = replace(DEFAULT_CARD, sharpness_features="crease-53")
    path = tmp_path / "three.onnx"
    write_model(edges, card, path, vertex_network=vertices, sharpness_network=sharp)
    model, psi = load_model(path), np.random.default_rng(0).random((5000, 53))
    with torch.no_grad():
        expected = torch.sigmoid(sharp(torch.from_numpy(psi).float())).numpy()
    np.testing.assert_allclose(model.sharpness(psi), expected, atol=SINGLE)
    with torch.no_grad():
        sharp.linear_layers[0].bias += 1e-2
    with pytest.raises(ParityError):
        check_sharpness(model, sharp)


@pytest.mark.parametrize("activation", ["gelu", "silu", "tanh"])
@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_a_file_says_what_the_network_says(activation, scale):
    network = dense(activation, scale)
    parity = check_parity(model_from_bytes(model_bytes(network, CARD), "test"), network)
    assert parity.difference <= TOLERANCE
    assert parity.length <= 1 + TOLERANCE
    if scale > 1:
        assert parity.length > 1 - TOLERANCE


def test_a_file_of_two_networks_says_what_both_say():
    edges, vertices = two_networks()
    model = model_from_bytes(two_networks_bytes(), "two")
    parity = check_parity(model, edges, vertex_network=vertices)
    assert parity.difference <= TOLERANCE
    with torch.no_grad():
        vertices.linear_layers[0].parametrizations.bias.original += 1e-3
    with pytest.raises(ParityError):
        check_parity(model, edges, vertex_network=vertices)
    with pytest.raises(ModelError, match="vertex features ring-10"):
        check_parity(model, edges)


@pytest.mark.parametrize("which", ["edges", "vertices"])
def test_answers_of_a_file_turn_with_the_features(which):
    model = model_from_bytes(two_networks_bytes(), "tied")
    ask, group = (model, EDGES) if which == "edges" else (model.vertex_correction, VERTICES)
    rows = np.random.default_rng(0).uniform(-1, 1, (500, group.order.shape[1]))
    answers = ask(rows, 1.0)
    assert np.abs(answers).max() > 0.1
    for order, signs, local in zip(group.order, group.signs, group.local, strict=True):
        np.testing.assert_allclose(ask(rows[:, order] * signs, 1.0), answers * local, atol=SINGLE)


def test_tied_weights_are_dense_matrices_in_the_file():
    graph = onnx.load_from_string(two_networks_bytes()).graph
    shapes = {tensor.name: list(tensor.dims) for tensor in graph.initializer}
    assert [shapes[f"weight_{i}"] for i in range(3)] == [[32, 18], [32, 32], [3, 32]]
    assert [shapes[f"vertex_weight_{i}"] for i in range(3)] == [[16, 10], [16, 16], [3, 16]]
    assert {node.op_type for node in graph.node} == {
        *("Gemm", "Sigmoid", "Mul", "MatMul", "Max", "Sqrt", "Div"),
    }


def test_the_same_networks_give_the_same_bytes_and_nothing_of_this_machine():
    assert two_networks_bytes() == two_networks_bytes()
    proto = onnx.load_from_string(two_networks_bytes())
    assert [(entry.domain, entry.version) for entry in proto.opset_import] == [("", OPSET)]
    assert {node.op_type for node in proto.graph.node} <= ALLOWED_OPERATORS
    assert not proto.producer_version + proto.doc_string
    assert not any(node.doc_string for node in proto.graph.node)


@pytest.mark.parametrize(("activation", "fused"), [("gelu", "Gelu"), ("silu", "QuickGelu")])
def test_onnxruntime_computes_an_activation_in_one_operator(tmp_path, activation, fused):
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "optimised.onnx")
    data = model_bytes(dense(activation), CARD)
    onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    operators = [node.op_type for node in onnx.load(tmp_path / "optimised.onnx").graph.node]
    assert operators.count(fused) == 2


@pytest.mark.parametrize("version", [2, 3])
def test_no_file_of_a_retired_format_is_written(tmp_path, version):
    edges, vertices = two_networks()
    path = tmp_path / "old.onnx"
    with pytest.raises(ModelError, match=f"format {version}, which was never released"):
        write_model(edges, replace(DEFAULT_CARD, format=version), path, vertex_network=vertices)
    assert not path.exists()


@pytest.mark.parametrize("damage", [1e-5, float("nan")])
def test_a_file_that_differs_is_not_written(tmp_path, monkeypatch, damage):
    network, other = dense(), dense()
    with torch.no_grad():
        other.linear_layers[-1].bias += damage
    path = tmp_path / "model.onnx"
    path.write_bytes(b"the old file")
    monkeypatch.setattr(
        "export.model_file.model_bytes", lambda _, card, *rest: model_bytes(other, card)
    )
    with pytest.raises((ParityError, ModelError)) as caught:
        write_model(network, CARD, path)
    if isinstance(caught.value, ParityError):
        assert caught.value.budget in BUDGETS
        assert caught.value.difference > TOLERANCE
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.onnx"]
    assert path.read_bytes() == b"the old file"


@pytest.mark.parametrize("recipe", [paper(4), general(4)], ids=["paper", "general"])
def test_a_card_holds_the_whole_recipe(tmp_path, recipe):
    metrics = {"ridge-held-out": {"distance": {"percent": 12.0}}}
    made = initial_network, initial_vertex_network, initial_sharpness_network
    network, *others = (initial(recipe) for initial in made)
    checkpoint = Checkpoint(recipe, network, metrics, "machine", *others)
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
    if recipe.scale_free is None:
        assert card.format == 1
    else:
        form, rule = recipe.scale_free, recipe.vertex
        names = ("prior_strength", "network_scale", "fold_angle", "sharpness_levels", "base")
        assert all(getattr(card, name) == getattr(form, name) for name in names)
        assert (card.format, card.vertex_features) == (4, rule.features)
        assert card.vertex_gate_sharpness == rule.gate_sharpness


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


def test_a_file_for_polygons_says_what_its_four_networks_say(tmp_path):
    recipe = general_quad()
    networks = initial_networks(recipe)
    assert networks.face is not None
    last = networks.face.linear_layers[-1]
    with torch.no_grad():
        weight = torch.randn(last.weight.shape, generator=torch.Generator().manual_seed(0))
        last.weight = weight / 8
    path, saved = tmp_path / "quads.onnx", tmp_path / "quads.safetensors"
    parts = networks.vertex, networks.sharp, networks.face
    save_checkpoint(saved, Checkpoint(recipe, networks.edge, {}, "a", *parts))
    export_model(load_checkpoint(saved), path)
    model, rows = load_model(path), np.random.default_rng(0).uniform(-1, 1, (500, 8))
    with torch.no_grad():
        expected = networks.face(torch.from_numpy(rows).float(), 3.0).numpy()
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(model.face_correction(rows, 3.0), expected, atol=3 * SINGLE)
    # Turned over, a face's normal changes its sign.
    group = FACE_FEATURE_SETS["face-8"].symmetries
    turned = model.face_correction(rows[:, group.order[1]] * group.signs[1], 3.0)
    np.testing.assert_allclose(turned, -expected, atol=3 * SINGLE)
    # Sharpness is taken over.
    asked, bundled = np.random.default_rng(0).standard_normal((50, 53)), load_model("general-quad")
    np.testing.assert_allclose(model.sharpness(asked), bundled.sharpness(asked), atol=1e-6)
    assert not any(weight.requires_grad for weight in networks.sharp.parameters())
