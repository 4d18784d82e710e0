"""What an operator of the allow-list is: how it is computed, and the shape that it makes.

What later operator sets take as an input and earlier ones as an attribute (axes, limits, sizes) is
taken either way: which it may be in a file is checked before (operator_sets.py).

An outline is an array of one zero that is repeated without being stored: it has a shape and a type
and takes no memory, so that a call can be measured before it is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# An array each, or None where an input is left out.
Inputs = Sequence[Any]
Attributes = Mapping[str, Any]
Function = Callable[[Inputs, Attributes], list[np.ndarray]]


@dataclass(frozen=True)
class Operator:
    """How an operator is computed.

    Attributes:
        compute: arrays of inputs and attributes -> arrays of outputs.
        outline: the same for outlines. Operators that only look at their input in another way
            make outlines of outlines as they are.
        shaping: which inputs are sizes, axes or limits of axes: constants of the file.
    """

    compute: Function
    outline: Function
    shaping: tuple[int, ...] = ()


def outline_of(shape: Sequence[int], kind: np.typing.DTypeLike) -> np.ndarray:
    """Return an outline. Raises ValueError for a shape that no array has."""
    return np.broadcast_to(np.zeros((), dtype=kind), tuple(shape))


def broadcast(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    """Return the outline of inputs of one type spread over each other."""
    (kind,) = {each.dtype for each in inputs}
    return [outline_of(np.broadcast_shapes(*(each.shape for each in inputs)), kind)]


def compared(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    """Return the outline of what is true or false of such inputs."""
    (outline,) = broadcast(inputs, attributes)
    return [outline_of(outline.shape, np.bool_)]


def like_the_first(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    """Return the outline of the first input."""
    return [outline_of(inputs[0].shape, inputs[0].dtype)]


def elementwise(
    function: Callable[..., np.ndarray], outline: Function = broadcast, **defaults: float
) -> Operator:
    """Return a function of each value, with numbers as attributes."""

    def compute(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
        numbers = {name: attributes.get(name, default) for name, default in defaults.items()}
        return [np.asarray(function(*inputs, **numbers))]

    return Operator(compute, outline)


def folded(function: Callable[[Any, Any], np.ndarray]) -> Operator:
    """Return a function of two arrays, over any number of them."""

    def compute(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
        first, *others = inputs
        for other in others:
            first = function(first, other)
        return [np.asarray(first)]

    return Operator(compute, broadcast)


def reduction(function: Callable[..., np.ndarray]) -> Operator:
    """Return a function over axes: all of them where none are named."""

    def compute(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
        over, keep = _reduced(inputs, attributes), bool(attributes.get("keepdims", 1))
        return [np.asarray(function(inputs[0], axis=over, keepdims=keep))]

    def outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
        over, keep = _reduced(inputs, attributes), attributes.get("keepdims", 1)
        sizes = enumerate(inputs[0].shape)
        kept = [1 if axis in over else size for axis, size in sizes if keep or axis not in over]
        return [outline_of(kept, inputs[0].dtype)]

    return Operator(compute, outline, shaping=(1,))


def _reduced(inputs: Inputs, attributes: Attributes) -> tuple[int, ...]:
    """Return the axes that a reduction is over; none where each value stays by itself."""
    every, axes = range(inputs[0].ndim), whole_numbers(inputs, 1, attributes, "axes")
    if not axes:
        return () if attributes.get("noop_with_empty_axes", 0) else tuple(every)
    return tuple(every[axis] for axis in axes)


def whole_numbers(inputs: Inputs, index: int, attributes: Attributes, name: str) -> list[int]:
    """Return whole numbers of an input, else of an attribute; empty where both are left out."""
    if len(inputs) > index and inputs[index] is not None:
        return [int(value) for value in inputs[index].reshape(-1)]
    return list(attributes.get(name, []))
