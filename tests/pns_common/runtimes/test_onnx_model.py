"""A model file that breaks its contract is refused, and the error says which part."""

import hashlib
import pickle
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import onnx
import pytest
from onnx import helper

from pns_common import Mesh, ModelError, load_model, pns, refine
from pns_common.models.card import ModelCard
from pns_common.models.contract import CALL_ROWS
from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.onnx_model import bundled_models, model_from_bytes
from pns_common.runtimes.onnx_session import open_session
from tests.support.meshes import bumpy_sphere
from tests.support.networks import (
    CARD,
    breaking_off_bytes,
    model_bytes,
    perceptron_bytes,
    random_layers,
    random_model,
)

GOOD = perceptron_bytes(random_layers(0))
PASS = [helper.make_node("Slice", ["features", "from", "to", "axis"], ["three"])]
CUT = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}


def through(*nodes):
    """Nodes that lead from the first three features to the output."""
    return [*PASS, *nodes]


def changed_card(**changes):
    fields = {name: getattr(CARD, name) for name in ModelCard.__dataclass_fields__}
    return msgspec.json.encode(fields | changes).decode()


def refused(data):
    """The refusal of a file; the one in numpy is checked to say the same of what it expects."""
    errors = []
    for runtime in (open_session, open_network):
        with pytest.raises(ModelError) as caught:
            model_from_bytes(data, "bad", runtime)
        assert "bad" in str(caught.value)
        errors.append(caught.value)
    with_onnx, in_numpy = errors
    assert in_numpy.expected == with_onnx.expected
    return with_onnx


def test_a_good_file_loads_with_card_and_hash():
    model = model_from_bytes(GOOD, "good")
    assert model.card == CARD
    assert model.hash == hashlib.sha256(GOOD).hexdigest()
    assert model.size == len(GOOD)


@pytest.mark.parametrize("data", [b"", b"not a model", GOOD[: len(GOOD) // 2], bytes(1000)])
def test_bytes_that_are_no_onnx_file(data):
    assert "ONNX" in refused(data).expected


@pytest.mark.parametrize(
    ("card", "says"),
    [
        (None, "0"),
        ("{", "Expecting"),
        ("[]", "not an object"),
        ('{"format": NaN}', "no number"),
        ("[" * 100_000, "nested"),
        (changed_card(format=3), "format 3"),
        (changed_card(features="paper-9"), "paper-9"),
        (changed_card(orientation="left"), "left"),
        (changed_card(budget=-1.0), "budget"),
        (changed_card(gate_sharpness=0.0), "gate_sharpness"),
        (changed_card(budget="much"), "budget"),
        (changed_card(surprise=1), "surprise"),
        ('{"format": 1}', "missing"),
    ],
)
def test_a_wrong_card_is_named(card, says):
    assert says in refused(perceptron_bytes(random_layers(0), card=card)).found


@pytest.mark.parametrize("operator", ["Loop", "If", "Expand", "Tile", "RandomNormal", "Resize"])
def test_operators_off_the_list_are_refused_by_name(operator):
    nodes = through(helper.make_node(operator, ["three"], ["correction"]))
    data = model_bytes(nodes, CUT)
    error = refused(data)
    assert operator in error.found


def test_operators_of_another_domain_are_refused():
    node = helper.make_node("Gelu", ["three"], ["correction"], domain="com.microsoft")
    assert (
        "com.microsoft" in refused(model_bytes(through(node), CUT, domains=["com.microsoft"])).found
    )


def test_external_data_is_refused():
    model = onnx.load_from_string(GOOD)
    weight = model.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = onnx.TensorProto.EXTERNAL
    entry = weight.external_data.add()
    entry.key, entry.value = "location", "/etc/passwd"
    error = refused(model.SerializeToString())
    assert "external" in error.found.lower() or "passwd" in error.found


def test_external_data_in_a_constant_is_refused():
    tensor = onnx.TensorProto(name="c", data_type=onnx.TensorProto.FLOAT, dims=[1])
    tensor.data_location = onnx.TensorProto.EXTERNAL
    entry = tensor.external_data.add()
    entry.key, entry.value = "location", "secret.bin"
    nodes = through(
        helper.make_node("Constant", [], ["c"], value=tensor),
        helper.make_node("Mul", ["three", "c"], ["correction"]),
    )
    assert refused(model_bytes(nodes, CUT)).found == "external data"


def test_a_graph_inside_a_node_is_refused():
    inner = helper.make_graph([], "inner", [], [])
    node = helper.make_node("Identity", ["three"], ["correction"], body=inner)
    assert "graph" in refused(model_bytes(through(node), CUT)).found


def test_functions_of_the_files_own_are_refused():
    model = onnx.load_from_string(GOOD)
    opset = [helper.make_opsetid("", 20)]
    body = [helper.make_node("Neg", ["x"], ["y"])]
    model.functions.append(helper.make_function("", "Abs", ["x"], ["y"], body, opset))
    assert "functions" in refused(model.SerializeToString()).found


def test_sparse_weights_are_refused():
    model = onnx.load_from_string(GOOD)
    model.graph.sparse_initializer.add()
    assert "sparse" in refused(model.SerializeToString()).found


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        ([("features", ["edges", 6]), ("budget", [])], None),
        ([("features", ["edges", 5])], None),
        ([("features", ["edges", 5]), ("budget", [1])], None),
        ([("features", ["edges", 5]), ("budget", []), ("more", [])], None),
        (None, [("correction", ["edges", 4])]),
        (None, [("other", ["edges", 3])]),
    ],
)
def test_other_inputs_or_outputs_are_refused(inputs, outputs):
    name = outputs[0][0] if outputs else "correction"
    nodes = through(helper.make_node("Identity", ["three"], [name]))
    assert "puts" in refused(model_bytes(nodes, CUT, inputs=inputs, outputs=outputs)).expected


def test_answers_of_another_shape_are_refused():
    """The file declares [edges, 3] and returns fewer rows."""
    nodes = through(helper.make_node("Slice", ["three", "from", "to", "first"], ["correction"]))
    error = refused(model_bytes(nodes, CUT | {"first": np.array([0])}))
    assert (error.expected, error.found) == (f"correction of shape [{CALL_ROWS}, 3]", "[3, 3]")


def test_a_runtime_that_answers_otherwise_than_the_file_says_is_an_error():
    class Short:
        def run(self, output, inputs):
            return np.zeros((1, 3), dtype=np.float32)

    model = replace(random_model(0), _network=Short())
    with pytest.raises(ModelError, match="shape"):
        refine(Mesh(*bumpy_sphere()), pns(model))


def test_corrections_that_are_not_numbers_are_an_error():
    weights = CUT | {"zero": np.zeros(())}
    node = helper.make_node("Div", ["three", "zero"], ["correction"])
    model = model_from_bytes(model_bytes(through(node), weights), "nan")
    with pytest.raises(ModelError, match="finite"):
        refine(Mesh(*bumpy_sphere()), pns(model))


def test_a_graph_that_breaks_off_while_running_is_an_error_of_the_model():
    model = model_from_bytes(breaking_off_bytes(), "breaks")
    with pytest.raises(ModelError, match="runs to its end"):
        refine(Mesh(*bumpy_sphere()), pns(model))


def test_what_onnxruntime_has_no_kernel_for_is_refused_before_it_is_asked():
    """Allowed, valid, and the numbers are there: but not of this operator in this precision."""
    nodes = [
        helper.make_node("Cast", ["three"], ["wide"], to=onnx.TensorProto.DOUBLE),
        helper.make_node("Erf", ["wide"], ["made"]),
        helper.make_node("Cast", ["made"], ["correction"], to=onnx.TensorProto.FLOAT),
    ]
    data = model_bytes(through(*nodes), CUT)
    with pytest.raises(ModelError, match="Erf") as refusal:
        model_from_bytes(data, "double", open_session)
    assert refusal.value.expected == "a graph that onnxruntime runs"
    assert model_from_bytes(data, "double", open_network).size == len(data)


def test_a_rows_bits_depend_on_nothing_but_the_row():
    model = random_model(0)
    features = np.random.default_rng(0).uniform(-2, 2, (3 * CALL_ROWS + 17, 5))
    together = model(features, 1.0)
    for rows in (slice(0, 1), slice(5, CALL_ROWS + 6), slice(2 * CALL_ROWS + 3, None)):
        np.testing.assert_array_equal(model(features[rows], 1.0), together[rows])
    assert model(features[:0], 1.0).shape == (0, 3)


def test_a_model_travels_to_another_process():
    model = random_model(0)
    copy = pickle.loads(pickle.dumps(model))
    assert (copy.name, copy.hash, copy.card) == (model.name, model.hash, model.card)
    features = np.random.default_rng(0).uniform(-2, 2, (9, 5))
    np.testing.assert_array_equal(copy(features, 0.5), model(features, 0.5))


def test_a_file_that_is_not_there_lists_the_bundled_names():
    with pytest.raises(ModelError, match="bundled") as caught:
        load_model("no/such/model.onnx")
    assert caught.value.path == "no/such/model.onnx"


def test_a_file_too_large_is_not_read(tmp_path):
    path = tmp_path / "huge.onnx"
    with path.open("wb") as file:
        file.truncate(65 * 2**20)
    with pytest.raises(ModelError, match="bytes"):
        load_model(path)


def test_a_bundled_name_wins_over_a_file_and_a_path_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper").write_bytes(GOOD)
    assert load_model("paper").hash != hashlib.sha256(GOOD).hexdigest()
    for path in ("./paper", tmp_path / "paper", Path("paper")):
        assert load_model(path).hash == hashlib.sha256(GOOD).hexdigest()


def test_a_file_on_disk_is_called_by_its_stem(tmp_path):
    path = tmp_path / "mine.onnx"
    path.write_bytes(GOOD)
    assert load_model(path).name == "mine"


def test_the_default_model_is_bundled():
    assert load_model().name in bundled_models()


def test_a_sparse_constant_is_refused():
    constant = helper.make_node("Constant", [], ["c"], value_float=1.0)
    attribute = constant.attribute[0]
    attribute.Clear()
    attribute.name, attribute.type = "sparse_value", onnx.AttributeProto.SPARSE_TENSOR
    attribute.sparse_tensor.dims.append(1)
    nodes = through(constant, helper.make_node("Identity", ["three"], ["correction"]))
    assert refused(model_bytes(nodes, CUT)).found == "a sparse tensor"


def test_a_model_of_edges_alone_says_that_it_has_no_vertex_rule():
    with pytest.raises(ModelError, match="vertex rule"):
        load_model("paper").vertex_correction(np.zeros((1, 10)), 0.5)
