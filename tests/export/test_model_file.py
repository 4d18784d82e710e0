from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from export.model_file import checkpoint_card, export_model, write_model
from export.onnx_graph import OPSET, model_bytes
from export.parity import BUDGETS, ROWS, TOLERANCE, ParityError, check_parity, sample_features
from pns_common.runtimes.onnx_model import load_model, model_from_bytes
from tests.support.networks import gelu, smoothstep
from train.models.checkpoint import Checkpoint
from train.models.from_recipe import initial_network
from train.models.recipes import paper, paper_text
from train.models.torch_model import recipe_model

EXACT = {"gelu": gelu, "smoothstep": smoothstep, "tanh": np.tanh}
SMOOTHSTEP = replace(paper(), name="smoothstep", activation="smoothstep")
RECIPES = [
    pytest.param(recipe, id=recipe.activation) for recipe in (paper(), paper_text(), SMOOTHSTEP)
]


def card_of(recipe):
    return recipe_model(recipe, initial_network(recipe)).card


def scaled_network(recipe, scale):
    """An untrained network whose last layer is so large that the projection is at work."""
    network = initial_network(recipe)
    with torch.no_grad():
        network.linear_layers[-1].weight *= scale
    return network


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_file_says_what_the_network_says(recipe, scale):
    network = scaled_network(recipe, scale)
    model = model_from_bytes(model_bytes(network, card_of(recipe)), "test")
    parity = check_parity(model, network)
    assert parity.difference <= TOLERANCE
    assert parity.length <= 1 + TOLERANCE
    if scale > 1:
        assert parity.length > 1 - TOLERANCE


@pytest.mark.parametrize("recipe", RECIPES)
def test_file_against_a_float64_network_in_numpy(recipe):
    network = scaled_network(recipe, 3.0)
    features = sample_features(5)[::50]
    z = features.astype(np.float64)
    layers = [(layer.weight, layer.bias) for layer in network.linear_layers]
    for index, (weight, bias) in enumerate(layers):
        z = z @ weight.detach().numpy().T.astype(np.float64) + bias.detach().numpy()
        if index < len(layers) - 1:
            z = EXACT[recipe.activation](z)
    expected = 0.5 * z / np.maximum(1, np.linalg.norm(z, axis=1, keepdims=True))
    answered = model_from_bytes(model_bytes(network, card_of(recipe)), "test")(features, 0.5)
    np.testing.assert_allclose(answered, expected, rtol=0, atol=0.5e-6)


@pytest.mark.parametrize("recipe", RECIPES)
def test_same_network_same_bytes(recipe):
    first = model_bytes(initial_network(recipe), card_of(recipe))
    assert first == model_bytes(initial_network(recipe), card_of(recipe))
    assert first != model_bytes(initial_network(replace(recipe, seed=9)), card_of(recipe))


def test_graph_has_one_operator_set_and_nothing_from_this_machine():
    proto = onnx.load_from_string(model_bytes(initial_network(paper()), card_of(paper())))
    assert [(entry.domain, entry.version) for entry in proto.opset_import] == [("", OPSET)]
    assert not proto.producer_version
    assert not proto.doc_string
    assert not any(node.doc_string for node in proto.graph.node)


def test_onnxruntime_computes_the_gelu_in_one_operator(tmp_path):
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "optimised.onnx")
    data = model_bytes(initial_network(paper()), card_of(paper()))
    onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    operators = [node.op_type for node in onnx.load(tmp_path / "optimised.onnx").graph.node]
    assert operators.count("Gelu") == len(paper().hidden)
    assert "Erf" not in operators


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_rows_bits_do_not_depend_on_where_it_stands(recipe):
    model = model_from_bytes(model_bytes(initial_network(recipe), card_of(recipe)), "test")
    features = sample_features(5)[:3000]
    whole = model(features, 0.5)
    for cut in (1, 7, 1021, 2999):
        parts = np.concatenate([model(features[:cut], 0.5), model(features[cut:], 0.5)])
        np.testing.assert_array_equal(parts, whole)


def test_samples_hold_the_extremes():
    features = sample_features(5)
    assert features.shape == (ROWS, 5)
    assert features.dtype == np.float32
    assert features[:, 0].min() == 0
    assert features[:, 0].max() == 2
    assert features[:, 1:].min() == -30
    assert features[:, 1:].max() == 30
    assert max(BUDGETS) / min(BUDGETS) >= 1e9


def test_card_holds_the_whole_recipe():
    recipe = paper(4)
    metrics = {"ridge-held-out": {"distance": {"percent": 12.0}}}
    card = checkpoint_card(Checkpoint(recipe, initial_network(recipe), metrics, "machine"))
    assert (card.features, card.gate_sharpness, card.budget) == ("paper-5", 10.0, 0.5)
    assert card.orientation == "first-face"
    assert card.metrics == metrics
    assert card.training["recipe"] == "ridge"  # As the bundled file has it.
    assert card.training["machine"] == "machine"
    for name in ("seed", "steps", "hidden", "learning_rate"):
        assert card.training[name] == getattr(recipe, name)
    assert card.training["batch_size"] == recipe.training.batch_size


def test_written_file_loads_with_its_card(tmp_path):
    checkpoint = Checkpoint(paper(), initial_network(paper()), {"x": {"y": 1}}, "machine")
    exported = export_model(checkpoint, tmp_path / "models" / "mine.onnx")
    model = load_model(tmp_path / "models" / "mine.onnx")
    assert model.hash == exported.sha256
    assert model.card.metrics == {"x": {"y": 1}}
    assert [entry.name for entry in (tmp_path / "models").iterdir()] == ["mine.onnx"]


@pytest.mark.parametrize("damage", [1e-5, float("nan")])
def test_a_file_that_differs_is_not_written(tmp_path, monkeypatch, damage):
    network, other = initial_network(paper()), initial_network(paper())
    with torch.no_grad():
        other.linear_layers[-1].bias += damage
    path = tmp_path / "model.onnx"
    path.write_bytes(b"the old file")
    monkeypatch.setattr(
        "export.model_file.model_bytes", lambda _, card, *rest: model_bytes(other, card)
    )
    with pytest.raises(ParityError, match="differ") as caught:
        write_model(network, card_of(paper()), path)
    assert caught.value.budget in BUDGETS
    assert not caught.value.difference <= TOLERANCE
    assert path.read_bytes() == b"the old file"
    assert len(list(tmp_path.iterdir())) == 1
