"""A graph of the form that ``export`` writes, read as the perceptron that it is.

Each layer is a Gemm; GELU between them is x/2 (1 + erf(x/√2)), spelt out; at the end stands the
projection onto the ball, budget · z / max(1, ‖z‖). A graph of any other form is no perceptron here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pns_common.models.tied_form import Layer
from pns_common.runtimes.numpy_network.network import NumpyNetwork
from pns_common.runtimes.numpy_network.onnx_schema import Node

ROOT_TWO = float(np.float32(np.sqrt(2)))


def read_perceptron(network: NumpyNetwork, given: str, output: str) -> list[Layer] | None:
    """Read the layers between a checked graph's input and output; None for another form."""
    reader = _Reader(iter(network.leading_to(output)), network.weights)
    try:
        return reader.perceptron(given, output)
    except _OtherFormError:
        return None


class _OtherFormError(Exception):
    """The graph goes on otherwise."""


@dataclass(frozen=True, eq=False)
class _Reader:
    steps: Iterator[Node]
    weights: Mapping[str, np.ndarray]

    def perceptron(self, value: str, output: str) -> list[Layer]:
        layers: list[Layer] = []
        step = next(self.steps, None)
        while step is not None and step.operator == "Gemm":
            layers.append(self._layer(step, value))
            (z,) = step.outputs
            step = next(self.steps, None)
            if step is not None and step.operator == "Div":
                value = self._gelu(step, z)
                step = next(self.steps, None)
            else:
                self._projection(step, z, output)
                return layers
        raise _OtherFormError

    def _layer(self, step: Node, value: str) -> Layer:
        _check(step, "Gemm", value, None, None, transB=1)
        _, weight, bias = (self.weights.get(name) for name in step.inputs)
        if weight is None or bias is None or bias.shape != weight.shape[:1]:
            raise _OtherFormError
        return Layer(weight, bias)

    def _gelu(self, divided: Node, z: str) -> str:
        """Follow x/2 (1 + erf(x/√2)) from its first node on; returns its name."""
        _check(divided, "Div", z, None)
        erf = self._next("Erf", *divided.outputs)
        half = self._next("Mul", z, None)
        raised = self._next("Add", *erf.outputs, None)
        product = self._next("Mul", *half.outputs, *raised.outputs)
        for step, number in ((divided, ROOT_TWO), (half, 0.5), (raised, 1.0)):
            self._check_number(step.inputs[1], number)
        return product.outputs[0]

    def _projection(self, length: Node | None, z: str, output: str) -> None:
        if length is None:
            raise _OtherFormError
        _check(length, "ReduceL2", z, axes=[1], keepdims=1)
        divisor = self._next("Max", *length.outputs, None)
        self._check_number(divisor.inputs[1], 1.0)
        in_ball = self._next("Div", z, *divisor.outputs)
        answer = self._next("Mul", *in_ball.outputs, "budget")
        if answer.outputs != (output,):
            raise _OtherFormError

    def _next(self, operator: str, *inputs: str | None) -> Node:
        step = next(self.steps, None)
        if step is None:
            raise _OtherFormError
        _check(step, operator, *inputs)
        return step

    def _check_number(self, name: str, number: float) -> None:
        weight = self.weights.get(name)
        if weight is None or weight.shape != () or weight != number:
            raise _OtherFormError


def _check(step: Node, operator: str, *inputs: str | None, **attributes: Any) -> None:
    """Check that it is this operator of these inputs (None: any) and says just that."""
    fits = step.operator == operator and len(step.inputs) == len(inputs)
    fits = fits and len(step.outputs) == 1 and step.attributes == attributes
    if not fits or any(
        wanted not in (None, name) for wanted, name in zip(inputs, step.inputs, strict=True)
    ):
        raise _OtherFormError
