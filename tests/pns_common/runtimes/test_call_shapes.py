"""A model file asks for no more memory than a call may hold, and its shapes follow from itself."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from benchmarks.memory import peak_mib, reset_peak
from pns_common import ModelError
from pns_common.models.contract import CALL_ROWS, LARGEST_CALL
from pns_common.runtimes import call_shapes
from pns_common.runtimes.numpy_network import network, open_network
from pns_common.runtimes.onnx_model import bundled_models, load_model, model_from_bytes
from pns_common.runtimes.onnx_session import open_session
from tests.support.networks import model_bytes, perceptron_bytes, random_layers

node = helper.make_node
CUT = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}
THREE = node("Slice", ["features", "from", "to", "axis"], ["three"])
PLAIN = [THREE, node("Mul", ["three", "budget"], ["correction"])]
# Columns that fill a call: two tensors of them and two of three columns, four bytes a number.
WIDEST = LARGEST_CALL // (4 * CALL_ROWS * 2) - 3


def refused(data, *, in_numpy=None):
    """The refusal of a file, which takes little memory; the one in numpy expects the same."""
    errors = []
    for runtime in (open_session, open_network):
        reset_peak()
        before = peak_mib()
        with pytest.raises(ModelError) as caught:
            model_from_bytes(data, "bad", runtime)
        assert peak_mib() - before < 64
        errors.append(caught.value)
    assert errors[1].expected == (in_numpy or errors[0].expected)
    return errors[0]


def two_wide(width):
    """Two hidden tensors of so many columns."""
    nodes = [
        node("MatMul", ["features", "up"], ["wide"]),
        node("Tanh", ["wide"], ["bent"]),
        node("MatMul", ["bent", "down"], ["three"]),
        node("Mul", ["three", "budget"], ["correction"]),
    ]
    return model_bytes(nodes, {"up": np.zeros((5, width)), "down": np.zeros((width, 3))})


def doubled(source, axis, times):
    """Nodes that join a tensor to itself, again and again."""
    names = [source, *(f"twice{i}" for i in range(times))]
    return [
        node("Concat", [names[i]] * 2, [names[i + 1]], axis=axis) for i in range(len(names) - 1)
    ]


def test_wide_layers_are_taken_up_to_the_limit_and_no_further():
    assert model_from_bytes(two_wide(WIDEST), "wide")(np.zeros((1, 5)), 1.0).shape == (1, 3)
    error = refused(two_wide(WIDEST + 1))
    assert error.expected == f"at most {LARGEST_CALL} bytes in one call"
    assert int(error.found) > LARGEST_CALL


@pytest.mark.parametrize(
    ("nodes", "weights"),
    [
        (doubled("features", 1, 40), {}),
        (doubled("seed", 0, 40), {"seed": np.zeros(2)}),
        (
            [
                node("Transpose", ["features"], ["columns"]),
                *doubled("columns", 1, 8),
                node("Gemm", ["features", "twice7"], ["product"]),
            ],
            {},
        ),
        (
            [node("Add", ["column", "row"], ["table"])],
            {"column": np.zeros((20_000, 1)), "row": np.zeros((1, 20_000))},
        ),
    ],
    ids=["rows", "constants", "product", "broadcast"],
)
def test_what_grows_inside_a_small_file_is_refused_before_it_does(nodes, weights):
    data = model_bytes([*PLAIN, *nodes], CUT | weights)
    assert len(data) < 200_000
    assert "bytes in one call" in refused(data).expected


def test_lengths_that_no_number_holds_are_refused():
    nodes = [*PLAIN, *doubled("seed", 0, 70)]
    data = model_bytes(nodes, CUT | {"seed": np.zeros(2)})
    error = refused(data, in_numpy=f"at most {LARGEST_CALL} bytes in one call")
    assert "fit together" in error.expected


def test_a_shape_that_follows_from_values_is_refused_by_name():
    nodes = [
        THREE,
        node("Cast", ["sizes"], ["shape"], to=TensorProto.INT64),
        node("Reshape", ["three", "shape"], ["rows"]),
        node("Mul", ["rows", "budget"], ["correction"]),
    ]
    error = refused(model_bytes(nodes, CUT | {"sizes": np.array([1024.0, 3.0])}))
    assert (error.expected, error.found) == ("shapes that follow from the file", "rows")


def test_text_is_no_number():
    nodes = [*PLAIN, node("Cast", ["three"], ["words"], to=TensorProto.STRING)]
    error = refused(model_bytes(nodes, CUT), in_numpy="shapes that fit together")
    assert error.found == "words"


def test_a_split_into_other_parts_than_its_outputs_is_refused():
    """onnxruntime would end the process."""
    nodes = [*PLAIN, node("Split", ["features"], ["a", "b", "c"], axis=1, num_outputs=2)]
    assert "fit together" in refused(model_bytes(nodes, CUT)).expected


def test_what_a_file_says_of_its_own_tensors_is_not_believed():
    width = 8 * WIDEST
    proto = onnx.load_from_string(two_wide(width))
    small = helper.make_tensor_value_info("wide", TensorProto.FLOAT, [CALL_ROWS, 2])
    proto.graph.value_info.append(small)
    assert "bytes in one call" in refused(proto.SerializeToString()).expected
    # Before version 4 weights are inputs too, with a shape of their own.
    del proto.graph.value_info[:]
    proto.ir_version = 3
    proto.graph.input.extend(
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name, shape in (("up", [5, 2]), ("down", [2, 3]))
    )
    assert "bytes in one call" in refused(proto.SerializeToString()).expected


def test_an_old_file_whose_weights_are_inputs_is_taken():
    proto = onnx.load_from_string(two_wide(4))
    proto.ir_version = 3
    proto.graph.input.extend(
        helper.make_tensor_value_info(tensor.name, TensorProto.FLOAT, tensor.dims)
        for tensor in proto.graph.initializer
    )
    assert model_from_bytes(proto.SerializeToString(), "old")(np.zeros((2, 5)), 1.0).shape == (2, 3)


@pytest.mark.parametrize("name", bundled_models())
def test_bundled_models_stay_far_below_the_limit(name, monkeypatch):
    for runtime in (call_shapes, network):
        monkeypatch.setattr(runtime, "LARGEST_CALL", LARGEST_CALL // 4)
    load_model(name)


def test_a_file_may_ask_for_the_same_shapes_with_any_number_of_layers():
    deep = perceptron_bytes(random_layers(0, widths=(5, *[32] * 20, 3)))
    assert model_from_bytes(deep, "deep")(np.zeros((3, 5)), 1.0).shape == (3, 3)
