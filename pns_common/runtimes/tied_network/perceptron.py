"""A graph of the form that ``export`` writes, read as the perceptron that it is.

Each layer is a Gemm; between them stands x (½ + t (3/8 − t²/32)) with t = x within [−2, 2], spelt
out; at the end the projection onto the ball, budget · z / max(1, ‖z‖). A graph of any other form is
no perceptron here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pns_common.models.tied_form import Layer
from pns_common.runtimes.numpy_network.network import NumpyNetwork
from pns_common.runtimes.numpy_network.onnx_schema import Node


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
            if step is not None and step.operator == "Clip":
                value = self._smoothstep(step, z)
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

    def _smoothstep(self, limited: Node, z: str) -> str:
        """Follow x S(x) from its first node on; returns its name."""
        _check(limited, "Clip", z, None, None)
        (t,) = limited.outputs
        square = self._next("Mul", t, t)
        fall = self._next("Mul", *square.outputs, None)
        slope = self._next("Sub", None, *fall.outputs)
        odd = self._next("Mul", t, *slope.outputs)
        step = self._next("Add", *odd.outputs, None)
        product = self._next("Mul", z, *step.outputs)
        for name, number in (
            (limited.inputs[1], -2.0),
            (limited.inputs[2], 2.0),
            (fall.inputs[1], 1 / 32),
            (slope.inputs[0], 3 / 8),
            (step.inputs[1], 0.5),
        ):
            self._check_number(name, number)
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
