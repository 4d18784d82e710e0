"""A model file in numpy: near onnxruntime's answer, nearer the exact one, and alone."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from pns_common import Mesh, ModelError, pns, refine
from pns_common.models.contract import feature_inputs
from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.onnx_model import (
    BUNDLED,
    bundled_models,
    installed_runtime,
    model_from_bytes,
)
from pns_common.runtimes.onnx_session import open_session
from tests.support.meshes import bumpy_sphere
from tests.support.networks import (
    breaking_off_bytes,
    float64_network,
    model_bytes,
    perceptron_bytes,
    random_layers,
)
from train.certificates.double_precision import double_model, read_bytes

ROOT = Path(__file__).resolve().parents[4]
PASS = [helper.make_node("Slice", ["features", "from", "to", "axis"], ["three"])]
CUT = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}


def both(name):
    data = (BUNDLED / f"{name}.onnx").read_bytes()
    return model_from_bytes(data, name, open_session), model_from_bytes(data, name, open_network)


@pytest.mark.parametrize("name", bundled_models())
def test_bundled_models_answer_as_with_onnxruntime(name):
    """Up to the rounding of single precision, which onnxruntime computes in.

    It sums 64 products a hidden unit in the widest bundled network: 64 roundings of 2⁻²⁴ at worst.
    """
    with_runtime, in_numpy = both(name)
    rng = np.random.default_rng(0)
    for given, width in feature_inputs(with_runtime.card):
        rows = rng.uniform(-2, 2, (3000, width))
        ours, theirs = (
            model(rows, 0.7) if given == "features" else model.vertex_correction(rows, 0.7)
            for model in (in_numpy, with_runtime)
        )
        assert ours.dtype == theirs.dtype == np.float32
        assert np.abs(ours - theirs).max() <= 64 * 2.0**-24 * 0.7


@pytest.mark.parametrize("name", bundled_models())
def test_bundled_models_answer_as_the_reference_evaluator_does_in_double(name):
    """onnx's own evaluator, all of the file's weights widened: what is left is one rounding."""
    _, in_numpy = both(name)
    exact = double_model(in_numpy, read_bytes(name))
    rng = np.random.default_rng(0)
    for given, width in feature_inputs(in_numpy.card):
        # The evaluator is given what the network reads: single precision.
        rows = rng.uniform(-2, 2, (300, width)).astype(np.float32)
        ours, theirs = (
            model(rows, 0.5) if given == "features" else model.vertex_correction(rows, 0.5)
            for model in (in_numpy, exact)
        )
        assert theirs.dtype == np.float64
        assert np.abs(ours - theirs).max() <= 2.0**-26 + 1e-12


@pytest.mark.parametrize("name", bundled_models())
def test_refined_positions_are_onnxruntimes_to_single_precision(name):
    """Relative to the reference length R, on a coarse mesh: the finer, the nearer (h²)."""
    mesh = Mesh(*bumpy_sphere())
    evaluated, by_onnxruntime = (refine(mesh, pns(model), levels=2) for model in both(name))
    length = evaluated.report["reference_length"]
    assert np.abs(evaluated.mesh.vertices - by_onnxruntime.mesh.vertices).max() <= 4e-7 * length


def test_the_answer_is_the_exact_one_rounded_once():
    layers = [(w.astype(np.float32), b.astype(np.float32)) for w, b in random_layers(3)]
    model = model_from_bytes(perceptron_bytes(layers), "random", open_network)
    rows = np.random.default_rng(1).uniform(-2, 2, (500, 5)).astype(np.float32)
    exact = float64_network(layers)(rows.astype(float))
    assert np.abs(model(rows, 1.0) - exact).max() <= 2.0**-25 + 1e-12


def test_a_rows_bits_depend_on_nothing_but_the_row():
    _, model = both("signed")
    rows = np.random.default_rng(0).uniform(-2, 2, (1500, 18))
    np.testing.assert_array_equal(model(rows[1020:1030], 1.0), model(rows, 1.0)[1020:1030])


def test_a_graph_that_breaks_off_while_running_is_an_error_of_the_model():
    model = model_from_bytes(breaking_off_bytes(), "breaks", open_network)
    with pytest.raises(ModelError, match="runs to its end"):
        refine(Mesh(*bumpy_sphere()), pns(model))


def refused(nodes, weights=CUT):
    with pytest.raises(ModelError) as caught:
        open_network(model_bytes([*PASS, *nodes], weights), "bad")
    return caught.value.found


def make(operator, inputs, output="correction", **attributes):
    return helper.make_node(operator, inputs, [output], **attributes)


ANSWER = make("Identity", ["three"])


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        ([make("Neg", ["nothing"])], "out of order"),
        ([make("Neg", ["three"], "three"), ANSWER], "out of order"),
        ([make("Neg", ["three"], surprise=1)], "attribute surprise"),
        ([make("MatMul", ["three", "three"])], "MatMul"),
        ([make("Gemm", ["three", "three"])], "Gemm"),
        ([make("Where", ["three", "three", "three"])], "Where"),
        ([make("Gather", ["three", "three"])], "Gather"),
        ([make("Concat", ["three", "features"], axis=0)], "Concat"),
        ([make("Split", ["three", "to"], "x", axis=1), make("Add", ["x", "from"])], "Add"),
        ([make("Split", ["three", "axis"], "x", axis=1), ANSWER], "Split"),
        ([make("Reshape", ["three", "to"])], "Reshape"),
        ([make("Cast", ["three"], to=16)], "Cast"),
        ([make("Constant", [], "c", value_string="x"), ANSWER], "attribute value_string"),
        ([make("Neg", ["three"], "x"), ANSWER, make("Abs", ["x"])], "out of order"),
    ],
)
def test_a_graph_that_does_not_fit_together_is_refused_by_its_node(nodes, says):
    assert says in refused(nodes)


def test_two_weights_of_one_name_are_refused():
    proto = onnx.load_from_string(model_bytes([*PASS, ANSWER], CUT))
    proto.graph.initializer.append(proto.graph.initializer[0])
    with pytest.raises(ModelError, match="two weights"):
        open_network(proto.SerializeToString(), "bad")


def test_operator_sets_that_broadcast_otherwise_are_refused():
    proto = onnx.load_from_string(model_bytes([*PASS, ANSWER], CUT))
    proto.opset_import[0].version = 6
    with pytest.raises(ModelError, match="operator set 7"):
        open_network(proto.SerializeToString(), "bad")


def test_a_bias_that_makes_a_product_larger_is_refused():
    weights = {"row": np.zeros((1, 3)), "square": np.zeros((3, 3)), "tall": np.zeros((4, 3))}
    assert "a bias of shape" in refused(
        [make("Gemm", ["row", "square", "tall"], "x"), ANSWER], CUT | weights
    )


def test_weights_of_a_type_that_no_operator_takes_are_refused():
    proto = onnx.load_from_string(model_bytes([*PASS, ANSWER], CUT))
    proto.graph.initializer.append(helper.make_tensor("words", onnx.TensorProto.STRING, [1], ["a"]))
    with pytest.raises(ModelError, match="unknown field 6"):
        open_network(proto.SerializeToString(), "bad")


def constant(**fields):
    """A file with a constant whose attribute has these fields and no others."""
    proto = onnx.load_from_string(
        model_bytes([*PASS, make("Constant", [], "c", value_float=1.0), ANSWER], CUT)
    )
    attribute = proto.graph.node[1].attribute[0]
    attribute.Clear()
    attribute.name = "value"
    for name, value in fields.items():
        setattr(attribute, name, value)
    return proto.SerializeToString()


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"type": onnx.AttributeProto.TENSOR}, "without its tensor"),
        ({"type": onnx.AttributeProto.STRINGS}, "of type 8"),
    ],
)
def test_an_attribute_that_holds_nothing_to_read_is_refused(fields, says):
    with pytest.raises(ModelError, match=says):
        open_network(constant(**fields), "bad")


def test_a_tensor_of_words_is_refused():
    proto = onnx.load_from_string(model_bytes([*PASS, ANSWER], CUT))
    proto.graph.initializer.add(name="words", data_type=onnx.TensorProto.STRING, dims=[0])
    with pytest.raises(ModelError, match="a tensor of type 8"):
        open_network(proto.SerializeToString(), "bad")


def test_a_file_without_a_graph_is_refused():
    with pytest.raises(ModelError, match="no graph"):
        open_network(b"", "empty")


WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked!r}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Absent())
"""
BLOCKED = ("onnxruntime", "onnx", "google", "msgspec", "scipy", "trimesh", "pydantic", "typer")
ALONE = """
import importlib.util
spec = importlib.util.find_spec
def find_spec(name):
    try:
        return spec(name)
    except ModuleNotFoundError:
        return None
importlib.util.find_spec = find_spec
import numpy as np
from pns_common import Mesh, load_model, pns, refine
mesh = Mesh(np.eye(3), [[0, 1, 2]])
for name in ("paper", "general"):
    refined = refine(mesh, pns(load_model(name)), levels=2)
    print(type(load_model(name)._network).__name__, len(refined.mesh.faces))
"""


def test_the_library_works_with_numpy_alone():
    code = WITHOUT.format(blocked=BLOCKED) + ALONE
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["NumpyNetwork", "16", "TiedNetwork", "16"]


def test_importing_the_library_and_loading_its_default_model_loads_no_runtime():
    code = "import sys, pns_common; pns_common.load_model(); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert not set(done.stdout.split()) & {"onnx", "onnxruntime", "msgspec", "google.protobuf"}


def test_onnxruntime_runs_other_models_where_it_is_installed():
    assert installed_runtime() is open_session
