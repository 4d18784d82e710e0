"""Model files of format 2: a second network for old vertices, checked as strictly as the first."""

import pickle
from dataclasses import replace

import msgspec
import numpy as np
import onnx
import pytest
import torch

from export.model_file import write_model
from export.onnx_graph import model_bytes
from export.parity import TOLERANCE, ParityError, check_parity
from pns_common import Mesh, ModelError, load_model, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.features.ring_features import RING_10
from pns_common.models.card import ModelCard
from pns_common.models.contract import ALLOWED_OPERATORS, CALL_ROWS
from pns_common.runtimes.onnx_model import model_from_bytes
from pns_common.schemes import vertex_operator
from tests.support.meshes import bent, bumpy_sphere, grid
from tests.support.networks import perceptron_bytes, random_layers
from train.certificates.certify import run_steps, scheme_steps
from train.certificates.double_precision import double_model
from train.certificates.model_file import keeps_its_word
from train.certificates.subject import in_double, subject_of_model, subject_of_network
from train.fitting.one_step import refine_once
from train.models.from_recipe import initial_network, recipe_operator
from train.models.networks import SymmetricNet
from train.models.recipes import paper
from train.models.torch_model import TorchModel, recipe_model

RECIPE = replace(paper(), features="signed-18", orientation="symmetric")
FIELDS = {"format": 2, "vertex_features": "ring-10", "vertex_gate_sharpness": 10.0}


def two_networks(scale=3.0):
    """Loud random networks as a torch model."""
    network = initial_network(RECIPE)
    generator = torch.Generator().manual_seed(1)
    vertices = SymmetricNet(RING_10.symmetries, (16, 16), "gelu", generator)
    with torch.no_grad():
        for net in (network, vertices):
            net.linear_layers[-1].weight *= scale
    card = replace(recipe_model(RECIPE, network).card, **FIELDS)
    return TorchModel("two", card, network, vertices)


def file_bytes(model, card=None):
    return model_bytes(model.network, card or model.card, model.vertex_network)


@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_file_says_what_both_networks_say(scale):
    model = two_networks(scale)
    parity = check_parity(
        model_from_bytes(file_bytes(model), "two"),
        model.network,
        vertex_network=model.vertex_network,
    )
    assert parity.difference <= TOLERANCE
    assert parity.length <= 1 + TOLERANCE


def test_same_networks_same_bytes_and_only_listed_operators():
    data = file_bytes(two_networks())
    assert data == file_bytes(two_networks())
    operators = {node.op_type for node in onnx.load_from_string(data).graph.node}
    assert operators <= ALLOWED_OPERATORS


def test_written_file_loads_and_refines_as_the_networks_do(tmp_path):
    model = two_networks()
    path = tmp_path / "two.onnx"
    write_model(model.network, model.card, path, vertex_network=model.vertex_network)
    loaded = load_model(path)
    assert loaded.card == model.card
    mesh = Mesh(*grid(7, bent))
    refined = refine(mesh, pns(loaded), 2, 1.0)
    expected = refine(mesh, pns(model), 2, 1.0)
    np.testing.assert_allclose(refined.mesh.vertices, expected.mesh.vertices, rtol=0, atol=1e-6)
    assert refined.report["levels"][0]["vertex_rule"]["proximity_ratio"]["max"] > 0.01
    again = refine(mesh, pns(pickle.loads(pickle.dumps(loaded))), 2, 1.0)
    np.testing.assert_array_equal(again.mesh.vertices, refined.mesh.vertices)


def test_a_second_network_that_differs_is_not_written(tmp_path):
    model = two_networks()
    data = file_bytes(model)
    with torch.no_grad():
        model.vertex_network.linear_layers[-1].bias += 1e-4
    with pytest.raises(ParityError):
        check_parity(
            model_from_bytes(data, "two"), model.network, vertex_network=model.vertex_network
        )


def test_rows_do_not_depend_on_how_many_there_are():
    loaded = model_from_bytes(file_bytes(two_networks()), "two")
    rows = np.random.default_rng(0).uniform(-1, 1, (CALL_ROWS + 7, RING_10.count))
    whole = loaded.vertex_correction(rows, 1.0)
    np.testing.assert_array_equal(
        loaded.vertex_correction(rows[CALL_ROWS:], 1.0), whole[CALL_ROWS:]
    )
    assert loaded.vertex_correction(rows[:0], 1.0).shape == (0, 3)


def test_a_model_without_a_vertex_rule_says_so():
    loaded = model_from_bytes(perceptron_bytes(random_layers(0)), "plain")
    with pytest.raises(ModelError, match="a vertex rule"):
        loaded.vertex_correction(np.zeros((1, RING_10.count)), 1.0)
    with pytest.raises(ModelError, match="a vertex rule"):
        recipe_model(paper(), initial_network(paper())).vertex_correction(np.zeros((1, 10)), 1.0)


def card_text(**changes):
    """A card as JSON, None for a field that is left out."""
    fields = msgspec.json.decode(two_networks().card.to_json()) | changes
    return msgspec.json.encode({k: v for k, v in fields.items() if v is not None}).decode()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"format": 1}, "vertex fields in format 1"),
        ({"format": 4}, "format 4, not 1 or 2 or 3"),
        ({"format": 3}, "format 3 without learned_levels"),
        ({"vertex_features": "ring-99"}, "ring-99"),
        ({"vertex_features": None}, "without the other"),
        ({"vertex_gate_sharpness": None}, "without the other"),
        ({"vertex_gate_sharpness": -1.0}, "vertex_gate_sharpness"),
    ],
)
def test_a_wrong_card_is_named(changes, says):
    with pytest.raises(ValueError, match=says):
        ModelCard.from_json(card_text(**changes))


def test_vertex_fields_stand_on_the_card_only_where_there_are_some():
    plain = recipe_model(paper(), initial_network(paper())).card
    assert "vertex" not in plain.to_json()
    assert ModelCard.from_json(two_networks().card.to_json()) == two_networks().card
    assert ModelCard.from_json(card_text(vertex_features=None, vertex_gate_sharpness=None))


def test_inputs_and_outputs_must_be_those_of_the_card():
    model = two_networks()
    plain = replace(model.card, vertex_features=None, vertex_gate_sharpness=None)
    with pytest.raises(ModelError, match="inputs"):
        model_from_bytes(file_bytes(model, plain), "two")
    with pytest.raises(ModelError, match="inputs"):
        model_from_bytes(model_bytes(model.network, model.card), "two")


def test_a_file_of_format_2_may_do_without():
    model = two_networks()
    plain = replace(model.card, vertex_features=None, vertex_gate_sharpness=None)
    loaded = model_from_bytes(model_bytes(model.network, plain), "two")
    report = refine(Mesh(*bumpy_sphere()), pns(loaded), 1).report
    assert "vertex_rule" not in report["levels"][0]


def test_training_step_is_the_products_step():
    model = two_networks()
    exact = TorchModel(
        "exact", model.card, in_double(model.network), in_double(model.vertex_network)
    )
    mesh = Mesh(*grid(7, bent))
    topology = build_topology(np.array(mesh.faces), len(mesh.vertices))
    rule = vertex_operator(exact)
    network = exact.vertex_network
    differentiable = replace(rule, network=lambda rows: network(rows, 1.0))
    points = torch.tensor(mesh.vertices, requires_grad=True)
    step = refine_once(
        points, topology, recipe_operator(RECIPE, exact.network), RECIPE.budget, differentiable
    )
    refined = refine(mesh, pns(exact), 1, reference_length=1.0)
    np.testing.assert_allclose(step.points.detach(), refined.mesh.vertices, rtol=0, atol=1e-14)
    inner = refined.ratio[: topology.vertex_count]
    np.testing.assert_allclose(step.vertex_ratio.detach(), inner[inner > 0], rtol=0, atol=1e-13)
    step.points.sum().backward()
    assert torch.isfinite(points.grad).all()
    for parameter in network.parameters():
        assert parameter.grad.abs().max() > 0


def test_the_file_in_double_precision_is_the_network_in_double_precision():
    model = two_networks()
    data = file_bytes(model)
    loaded = model_from_bytes(data, "two")
    rows = np.random.default_rng(0).uniform(-1, 1, (20, RING_10.count))
    with torch.no_grad():
        expected = in_double(model.vertex_network)(torch.from_numpy(rows), 0.5).numpy()
    answered = double_model(loaded, data).vertex_correction(rows, 0.5)
    # The file holds √2 of the GELU in single precision.
    np.testing.assert_allclose(answered, expected, rtol=0, atol=1e-7)


def test_every_certificate_passes_with_the_vertex_rule_on():
    model = two_networks(1e3)  # loud: both rules use their whole envelope
    subject = subject_of_network(model)
    certificates = run_steps(scheme_steps(subject, (), 0, (3, 6, 9)), lambda *_: None)
    failed = [
        (certificate.theorem, certificate.name, certificate.value, certificate.where)
        for certificate in certificates
        if certificate.counts and not certificate.passed
    ]
    assert not failed


def test_the_file_keeps_its_word_for_vertices_too():
    model = two_networks(1e3)
    data = file_bytes(model)
    rows = keeps_its_word(model_from_bytes(data, "two"))
    assert all(row.passed for row in rows)
    assert sum("vertex" in row.name for row in rows) == 2
    subject = subject_of_model(
        model_from_bytes(data, "two"), double_model(model_from_bytes(data, "two"), data)
    )
    assert subject.is_single_precision
