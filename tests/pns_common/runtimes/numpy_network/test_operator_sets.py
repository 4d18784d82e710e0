"""A node may say what its operator set lets it say: as ONNX defines it, in every runtime."""

import numpy as np
import onnx
import pytest
from onnx import defs, helper

from pns_common import ModelError
from pns_common.runtimes.numpy_network import open_network
from pns_common.runtimes.numpy_network.operator_sets import FIRST_OPERATOR_SET, FORMS, fault_of
from pns_common.runtimes.numpy_network.operators import OPERATORS
from pns_common.runtimes.onnx_session import open_session
from tests.support.networks import model_bytes

# What is not computed here.
LEFT_OUT = {"sparse_value", "value_string", "value_strings", "round_mode"}
SETS = range(FIRST_OPERATOR_SET, defs.onnx_opset_version() + 1)


@pytest.mark.parametrize("operator", sorted(OPERATORS))
def test_forms_are_those_that_onnx_defines(operator):
    for version in SETS:
        try:
            schema = defs.get_schema(operator, version)
        except defs.SchemaError:
            assert fault_of(operator, 1, [], version) == f"{operator} in operator set {version}"
            continue
        attributes = set(schema.attributes) - LEFT_OUT
        for inputs in range(8):
            taken = schema.min_input <= inputs <= schema.max_input
            assert (fault_of(operator, inputs, sorted(attributes), version) is None) == taken
        fewest = schema.min_input
        for other in {name for form in FORMS[operator] for name in form.attributes} - attributes:
            fault = fault_of(operator, fewest, [other], version)
            assert fault == f"{operator} with attribute {other}, in operator set {version}"


def three(operator, inputs=(), **attributes):
    """Nodes that answer with an operator of the first three features."""
    cut = helper.make_node("Slice", ["features", "from", "to", "axis"], ["three"])
    return [cut, helper.make_node(operator, ["three", *inputs], ["correction"], **attributes)]


@pytest.mark.parametrize("opened", [open_network, open_session])
@pytest.mark.parametrize(
    ("nodes", "first", "last"),
    [
        (three("Clip", min=-0.5, max=0.5), 10, 10),
        (three("Clip", ["low", "high"]), 11, 20),
        (three("Add", ["low"]), 10, 20),
        (three("Add", ["low", "high"]), 0, 0),
        (three("Erf", ["low"]), 0, 0),
        (three("Gelu"), 20, 20),
    ],
)
def test_runtimes_take_and_refuse_the_same_operator_sets(opened, nodes, first, last):
    weights = {"from": np.array([0]), "to": np.array([3]), "axis": np.array([1])}
    weights |= {"low": np.float32(-0.5), "high": np.float32(0.5)}
    for version in range(10, 21):
        data = model_bytes(nodes, weights, opset=version)
        if first <= version <= last:
            opened(data, "good")
            continue
        with pytest.raises(ModelError, match="a valid ONNX model") as refusal:
            opened(data, "bad")
        operator = onnx.load_from_string(data).graph.node[1].op_type
        assert operator in refusal.value.found
