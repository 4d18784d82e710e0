"""Each operator of the allow-list against onnxruntime and against onnx's own reference."""

import math

import numpy as np
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from pns_common.models.contract import ALLOWED_OPERATORS
from pns_common.runtimes.numpy_network.network import NumpyNetwork, _outlines
from pns_common.runtimes.numpy_network.onnx_schema import node as read_node
from pns_common.runtimes.numpy_network.onnx_schema import read_model, tensor, text
from pns_common.runtimes.numpy_network.operators import OPERATORS

RNG = np.random.default_rng(0)
A = RNG.normal(0, 2, (4, 6)).astype(np.float32)
B = RNG.normal(0, 2, (4, 6)).astype(np.float32)
ROW = RNG.normal(0, 2, (6,)).astype(np.float32)
POSITIVE = np.abs(A) + np.float32(0.1)
SQUARE = RNG.normal(0, 1, (6, 5)).astype(np.float32)
WHOLE = np.array([[3, -7, 8], [-9, 5, 2]])


def ints(*values):
    return np.array(values, dtype=np.int64)


UNARY = ["Abs", "Cos", "Elu", "Erf", "Exp", "Gelu", "Identity", "LeakyRelu", "Neg", "Relu", "Selu"]
UNARY += ["Sigmoid", "Sin", "Softplus", "Tanh"]
REDUCTIONS = ["ReduceL2", "ReduceMax", "ReduceMean", "ReduceSum", "ReduceSumSquare"]
# (operator, inputs, attributes[, operator set]); the first input is what a call gives, the others
# are constants of the file.
CASES = [
    *((name, [A], {}) for name in UNARY),
    *((name, [POSITIVE], {}) for name in ("Log", "Reciprocal", "Sqrt")),
    *((name, [A, B], {}) for name in ("Add", "Div", "Greater", "Less", "Mul", "Sub")),
    *((name, [A, ROW], {}) for name in ("Add", "Div", "Greater", "Less", "Mul", "Sub")),
    *((name, [A, B, ROW], {}) for name in ("Max", "Min", "Sum")),
    *((name, [A], {}) for name in ("Max", "Min", "Sum")),
    *((name, [A, ints(1)], {"keepdims": 0}) for name in REDUCTIONS),
    *((name, [A, ints(-1, 0)], {}) for name in REDUCTIONS),
    *((name, [A], {"keepdims": 1}) for name in REDUCTIONS),
    *((name, [A], {"noop_with_empty_axes": 1}) for name in REDUCTIONS),
    *((name, [A], {"axes": [1]}, 12) for name in REDUCTIONS),
    ("Gelu", [A], {"approximate": "tanh"}),
    ("Elu", [A], {"alpha": 0.5}),
    ("LeakyRelu", [A], {"alpha": 0.3}),
    ("Div", [WHOLE, np.array([[2, 2, -3], [4, -5, 2]])], {}),
    ("Pow", [POSITIVE, np.float32(1.5)], {}),
    ("Pow", [A, ints(2)], {}),
    ("Cast", [A], {"to": TensorProto.INT64}),
    ("Cast", [WHOLE], {"to": TensorProto.FLOAT}),
    ("Cast", [A], {"to": TensorProto.BOOL}),
    ("Clip", [A, np.float32(-0.5), np.float32(0.7)], {}),
    ("Clip", [A, None, np.float32(0.7)], {}),
    ("Clip", [A], {"min": -0.5}, 10),
    ("Concat", [A, B], {"axis": 0}),
    ("Concat", [A, B, A], {"axis": -1}),
    ("Constant", [], {"value": numpy_helper.from_array(A)}),
    ("Constant", [], {"value_float": 1.5}),
    ("Constant", [], {"value_floats": [1.5, 2.5]}),
    ("Constant", [], {"value_int": 3}),
    ("Constant", [], {"value_ints": [3, 4]}),
    ("Gather", [A, ints(2, 0, 0)], {"axis": 1}),
    ("Gather", [A, np.array([[1, -1]])], {}),
    ("Gemm", [A, SQUARE, RNG.normal(size=5).astype(np.float32)], {}),
    ("Gemm", [A, SQUARE], {"alpha": 0.5}),
    ("Gemm", [A, B, np.float32([1, 2, 3, 4])], {"transB": 1, "beta": 0.3}),
    ("Gemm", [A, B], {"transA": 1}),
    ("MatMul", [A, SQUARE], {}),
    ("MatMul", [A, ROW], {}),
    ("MatMul", [ROW, SQUARE], {}),
    ("MatMul", [np.stack([A, B]), SQUARE], {}),
    ("Reshape", [A, ints(-1, 3)], {}),
    ("Reshape", [A, ints(0, 2, -1)], {}),
    ("Slice", [A, ints(1), ints(3)], {}),
    ("Slice", [A, ints(5, 0), ints(-100, 4), ints(1, 0), ints(-2, 1)], {}),
    ("Slice", [A], {"starts": [1], "ends": [3], "axes": [1]}, 9),
    ("Split", [A, ints(1, 3)], {}),
    ("Split", [SQUARE], {"axis": 1, "num_outputs": 3}),
    ("Split", [A], {"axis": 1, "split": [2, 4]}, 11),
    ("Squeeze", [A[None, :, :1]], {}),
    ("Squeeze", [A[None, :, :1], ints(0)], {}),
    ("Transpose", [A], {}),
    ("Transpose", [A], {"perm": [1, 0]}),
    ("Unsqueeze", [A, ints(0, -1)], {}),
    ("Where", [A > 0, A, ROW], {}),
]


def made(case):
    """A model of one node: its proto, and the input that a call gives by name."""
    operator, inputs, attributes, version = [*case, 20][:4]
    names = ["" if value is None else f"input{i}" for i, value in enumerate(inputs)]
    count = attributes.get("num_outputs", 2) if operator == "Split" else 1
    outputs = [f"out{i}" for i in range(count)]
    arrays = {name: np.asarray(value) for name, value in zip(names, inputs, strict=True) if name}
    graph = helper.make_graph(
        [helper.make_node(operator, names, outputs, **attributes)],
        "one",
        [
            helper.make_tensor_value_info(n, helper.np_dtype_to_tensor_dtype(a.dtype), a.shape)
            for n, a in arrays.items()
            if n == "input0"
        ],
        [helper.make_empty_tensor_value_info(name) for name in outputs],
        [numpy_helper.from_array(a, n) for n, a in arrays.items() if n != "input0"],
    )
    opsets = [helper.make_opsetid("", version)]
    model = helper.make_model(graph, opset_imports=opsets, ir_version=8)
    return model, {name: array for name, array in arrays.items() if name == "input0"}


def in_numpy(model, inputs):
    graph = read_model(model.SerializeToString())["graph"]
    weights = {text(each, "name"): tensor(each) for each in graph["initializer"]}
    network = NumpyNetwork([read_node(each) for each in graph["node"]], weights)
    values = {
        name: array.astype(float) if array.dtype.kind == "f" else array
        for name, array in inputs.items()
    }
    (step,) = network.nodes
    given = [(weights | values)[name] if name else None for name in step.inputs]
    results = OPERATORS[step.operator].compute(given, step.attributes)
    outlines = _outlines(network, values)
    for name, result in zip(step.outputs, results, strict=True):
        assert outlines[name].shape == result.shape
        assert outlines[name].dtype == result.dtype
    return results


def test_the_operators_are_those_of_the_allow_list():
    assert set(OPERATORS) == ALLOWED_OPERATORS
    assert {case[0] for case in CASES} == ALLOWED_OPERATORS


@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_an_operator_is_onnxruntimes(case):
    model, inputs = made(case)
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    for ours, theirs in zip(in_numpy(model, inputs), session.run(None, inputs), strict=True):
        assert ours.shape == theirs.shape
        assert ours.dtype.kind == theirs.dtype.kind
        np.testing.assert_allclose(ours, theirs, rtol=2e-6, atol=2e-6)


def in_double(model, inputs):
    """The same model and inputs in double precision."""
    for each in model.graph.initializer:
        array = numpy_helper.to_array(each)
        if array.dtype == np.float32:
            each.CopyFrom(numpy_helper.from_array(array.astype(float), each.name))
    for value in model.graph.input:
        if value.type.tensor_type.elem_type == TensorProto.FLOAT:
            value.type.tensor_type.elem_type = TensorProto.DOUBLE
    return model, {n: a.astype(float) if a.dtype.kind == "f" else a for n, a in inputs.items()}


# Their definitions in onnx are in single precision, and onnxruntime has them in no other.
SINGLE = {"Erf", "Gelu", "LeakyRelu", "Selu"}


@pytest.mark.parametrize(
    "case", [case for case in CASES if case[0] not in SINGLE], ids=lambda case: case[0]
)
def test_an_operator_is_onnxruntimes_in_double_precision(case):
    """Where onnxruntime leaves it out, onnx's reference."""
    model, inputs = in_double(*made(case))
    try:
        session = onnxruntime.InferenceSession(
            model.SerializeToString(), providers=["CPUExecutionProvider"]
        )
    except onnxruntime.capi.onnxruntime_pybind11_state.NotImplemented:
        session = ReferenceEvaluator(model)
    for ours, theirs in zip(in_numpy(model, inputs), session.run(None, inputs), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14)


def test_gelu_is_exact_to_double_precision():
    x = np.linspace(-8, 8, 1001)
    exact = [0.5 * value * math.erfc(-value / math.sqrt(2)) for value in x]
    (ours,) = OPERATORS["Gelu"].compute([x], {})
    np.testing.assert_allclose(ours, exact, rtol=0, atol=1e-14)
