"""The operators of the allow-list in numpy. Floats are double precision.

Definitions: https://onnx.ai/onnx/operators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from pns_common.runtimes.numpy_network.arrangements import ARRANGEMENTS
from pns_common.runtimes.numpy_network.erf import erf
from pns_common.runtimes.numpy_network.onnx_schema import HELD_TYPES
from pns_common.runtimes.numpy_network.operator import (
    Attributes,
    Inputs,
    Operator,
    broadcast,
    compared,
    elementwise,
    folded,
    like_the_first,
    outline_of,
    reduction,
)


def _divide(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    if a.dtype.kind == "f":
        return a / b
    return np.sign(a) * np.sign(b) * (np.abs(a) // np.abs(b))  # whole numbers: towards zero


def _gelu(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    (x,) = inputs
    if attributes.get("approximate", "none") == "tanh":
        return [0.5 * x * (1 + np.tanh(math.sqrt(2 / math.pi) * (x + 0.044715 * x**3)))]
    return [0.5 * x * (1 + erf(x * math.sqrt(0.5)))]


def _relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0)


def _elu(x: np.ndarray, alpha: float) -> np.ndarray:
    return np.where(x > 0, x, alpha * np.expm1(np.minimum(x, 0)))


def _selu(x: np.ndarray, alpha: float, gamma: float) -> np.ndarray:
    return gamma * _elu(x, alpha)


def _leaky_relu(x: np.ndarray, alpha: float) -> np.ndarray:
    return np.where(x < 0, alpha * x, x)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1 + np.tanh(0.5 * x))


def _softplus(x: np.ndarray) -> np.ndarray:
    return np.logaddexp(0, x)


def _reduce_l2(x: np.ndarray, axis: Any, keepdims: bool) -> np.ndarray:
    return np.sqrt(_reduce_sum_square(x, axis, keepdims))


def _reduce_sum_square(x: np.ndarray, axis: Any, keepdims: bool) -> np.ndarray:
    return np.sum(x * x, axis=axis, keepdims=keepdims)


def _clip(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    data: Any
    data, lowest, highest = [*inputs, None, None][:3]
    lowest = attributes.get("min") if lowest is None else lowest
    highest = attributes.get("max") if highest is None else highest
    data = data if lowest is None else np.maximum(data, lowest)
    return [data if highest is None else np.minimum(data, highest)]


def _cast(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [inputs[0].astype(HELD_TYPES[attributes["to"]])]


def _constant(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    ((name, value),) = attributes.items()
    return [np.asarray(value, dtype=np.int64 if name.startswith("value_int") else None)]


def _cast_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [outline_of(inputs[0].shape, HELD_TYPES[attributes["to"]])]


def _gemm(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    a, b = _gemm_factors(inputs, attributes)
    product = attributes.get("alpha", 1.0) * (a @ b)
    if len(inputs) < 3 or inputs[2] is None:
        return [product]
    return [product + attributes.get("beta", 1.0) * inputs[2]]


def _gemm_factors(inputs: Inputs, attributes: Attributes) -> tuple[np.ndarray, np.ndarray]:
    a, b = inputs[:2]
    return (
        a.T if attributes.get("transA", 0) else a,
        b.T if attributes.get("transB", 0) else b,
    )


def _gemm_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    (rows, inner), (inner_too, columns) = (x.shape for x in _gemm_factors(inputs, attributes))
    if inner != inner_too:
        raise ValueError(f"a product of {inner} columns and {inner_too} rows")
    shape = (rows, columns)
    bias = inputs[2] if len(inputs) > 2 else None
    if bias is not None and np.broadcast_shapes(bias.shape, shape) != shape:
        raise ValueError(f"a bias of shape {bias.shape} for {shape}")
    return [outline_of(shape, inputs[0].dtype)]


def _matmul(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    a, b = inputs
    return [np.asarray(a @ b)]


def _matmul_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    a, b = inputs
    if a.shape[-1] != b.shape[-2 if b.ndim > 1 else 0]:
        raise ValueError(f"a product of shapes {a.shape} and {b.shape}")
    stacks = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    rows, columns = a.shape[-2:-1], b.shape[-1:] if b.ndim > 1 else ()
    return [outline_of((*stacks, *rows, *columns), a.dtype)]


def _where(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [np.where(*inputs)]


def _where_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    condition, *values = inputs
    if condition.dtype != np.bool_:
        raise ValueError("a condition that is neither true nor false")
    (outline,) = broadcast(values, attributes)
    return [outline_of(np.broadcast_shapes(condition.shape, outline.shape), outline.dtype)]


def _pow(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    base, exponent = inputs
    return [np.power(base, exponent).astype(base.dtype)]


def _pow_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    base, exponent = inputs
    return [outline_of(np.broadcast_shapes(base.shape, exponent.shape), base.dtype)]


def _identity(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return list(inputs)


OPERATORS: Mapping[str, Operator] = MappingProxyType(
    {
        **ARRANGEMENTS,
        "Abs": elementwise(np.abs),
        "Add": elementwise(np.add),
        "Cast": Operator(_cast, _cast_outline),
        "Clip": Operator(_clip, like_the_first),
        "Constant": Operator(_constant, _constant),
        "Cos": elementwise(np.cos),
        "Div": elementwise(_divide),
        "Elu": elementwise(_elu, alpha=1.0),
        "Erf": elementwise(erf),
        "Exp": elementwise(np.exp),
        "Gelu": Operator(_gelu, like_the_first),
        "Gemm": Operator(_gemm, _gemm_outline),
        "Greater": elementwise(np.greater, compared),
        "Identity": Operator(_identity, _identity),
        "LeakyRelu": elementwise(_leaky_relu, alpha=float(np.float32(0.01))),
        "Less": elementwise(np.less, compared),
        "Log": elementwise(np.log),
        "MatMul": Operator(_matmul, _matmul_outline),
        "Max": folded(np.maximum),
        "Min": folded(np.minimum),
        "Mul": elementwise(np.multiply),
        "Neg": elementwise(np.negative),
        "Pow": Operator(_pow, _pow_outline),
        "Reciprocal": elementwise(np.reciprocal),
        "ReduceL2": reduction(_reduce_l2),
        "ReduceMax": reduction(np.max),
        "ReduceMean": reduction(np.mean),
        "ReduceSum": reduction(np.sum),
        "ReduceSumSquare": reduction(_reduce_sum_square),
        "Relu": elementwise(_relu),
        "Selu": elementwise(_selu, alpha=1.6732631921768188, gamma=1.0507010221481323),
        "Sigmoid": elementwise(_sigmoid),
        "Sin": elementwise(np.sin),
        "Softplus": elementwise(_softplus),
        "Sqrt": elementwise(np.sqrt),
        "Sub": elementwise(np.subtract),
        "Sum": folded(np.add),
        "Tanh": elementwise(np.tanh),
        "Where": Operator(_where, _where_outline),
    }
)
