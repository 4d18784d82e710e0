"""Messages of a model file as onnx writes them: tensors of each type, nodes, attributes."""

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from pns_common.runtimes.numpy_network.onnx_schema import node, read_model, tensor, text
from tests.support.networks import model_bytes


def graph_of(nodes=(), weights=()):
    """The graph of a file with these, as it is read back."""
    graph = helper.make_graph(list(nodes), "g", [], [], list(weights))
    return read_model(helper.make_model(graph).SerializeToString())["graph"]


@pytest.mark.parametrize(
    ("kind", "held"),
    [
        (TensorProto.FLOAT, np.float64),
        (TensorProto.DOUBLE, np.float64),
        (TensorProto.INT32, np.int64),
        (TensorProto.INT64, np.int64),
        (TensorProto.BOOL, np.bool_),
    ],
)
@pytest.mark.parametrize("raw", [False, True])
def test_tensors_are_read_from_bytes_and_from_numbers(kind, held, raw):
    values = np.array([[0, 1, 1], [1, 0, 1]])
    array = values.astype(helper.tensor_dtype_to_np_dtype(kind))
    data = array.tobytes() if raw else array.reshape(-1).tolist()
    (message,) = graph_of(weights=[helper.make_tensor("w", kind, (2, 3), data, raw)])["initializer"]
    read = tensor(message)
    assert (read.dtype, read.shape, text(message, "name")) == (held, (2, 3), "w")
    np.testing.assert_array_equal(read, values)


def test_numbers_of_another_count_than_the_shape_are_no_tensor():
    short = helper.make_tensor("w", TensorProto.FLOAT, (2,), [1.0, 2.0])
    short.dims[0] = 3
    (message,) = graph_of(weights=[short])["initializer"]
    with pytest.raises(ValueError, match="reshape"):
        tensor(message)


def test_a_node_has_its_names_and_the_values_of_its_attributes():
    table = np.array([[1.5, -2.0]], dtype=np.float32)
    given = {"f": 0.5, "i": -3, "s": "tanh", "floats": [1.0, 2.5], "ints": [0, -7], "zero": 0}
    made = helper.make_node(
        "Any", ["a", "", "b"], ["c"], **given, table=numpy_helper.from_array(table)
    )
    (message,) = graph_of([made])["node"]
    read = node(message)
    assert (read.operator, read.inputs, read.outputs) == ("Any", ("a", "", "b"), ("c",))
    np.testing.assert_array_equal(read.attributes.pop("table"), table)
    assert read.attributes == given


def test_a_field_that_is_left_out_is_an_empty_text_and_what_is_none_is_refused():
    message = read_model(model_bytes([], {}))
    assert text(message, "domain") == ""
    with pytest.raises(ValueError, match="utf-8"):
        text({"name": b"\xff"}, "name")
    with pytest.raises(ValueError, match="unknown field 99"):
        read_model(bytes([0x98, 0x06, 1]))
