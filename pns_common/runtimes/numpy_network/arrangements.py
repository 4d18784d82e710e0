"""The operators that only arrange values: join, pick, cut, and look at them in another shape."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from pns_common.runtimes.numpy_network.operator import (
    Attributes,
    Function,
    Inputs,
    Operator,
    outline_of,
    whole_numbers,
)


def _concat(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [np.concatenate(inputs, axis=attributes["axis"])]


def _concat_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    (kind,) = {each.dtype for each in inputs}
    (axes,) = {int(each.ndim) for each in inputs}
    joined = range(axes)[int(attributes["axis"])]
    shape = [
        sum(sizes) if axis == joined else _only(sizes)
        for axis, sizes in enumerate(zip(*(each.shape for each in inputs), strict=True))
    ]
    return [outline_of(shape, kind)]


def _only(sizes: Sequence[int]) -> int:
    (size,) = set(sizes)
    return size


def _gather(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    data, indices = inputs
    return [np.take(data, indices, axis=attributes.get("axis", 0))]


def _gather_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    data, indices = inputs
    if indices.dtype.kind != "i":
        raise ValueError("indices that are no whole numbers")
    axis = range(int(data.ndim))[int(attributes.get("axis", 0))]
    shape = (*data.shape[:axis], *indices.shape, *data.shape[axis + 1 :])
    return [outline_of(shape, data.dtype)]


def _reshape(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [inputs[0].reshape(_new_shape(inputs, attributes))]


def _reshape_outline(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [outline_of(_new_shape(inputs, attributes), inputs[0].dtype)]


def _new_shape(inputs: Inputs, attributes: Attributes) -> list[int]:
    """Return the sizes that Reshape names: 0 copies one, −1 is what is left."""
    data, sizes = inputs[0], whole_numbers(inputs, 1, attributes, "shape")
    if not attributes.get("allowzero", 0):
        sizes = [data.shape[axis] if size == 0 else size for axis, size in enumerate(sizes)]
    if sizes.count(-1) == 1:
        known = math.prod(size for size in sizes if size != -1)
        sizes = [data.size // known if size == -1 else size for size in sizes]
    if min(sizes, default=0) < 0 or math.prod(sizes) != data.size:
        raise ValueError(f"shape {data.shape} as {sizes}")
    return sizes


def _slice(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    data = inputs[0]
    starts, ends, axes, steps = (
        whole_numbers(inputs, index, attributes, name)
        for index, name in enumerate(("starts", "ends", "axes", "steps"), start=1)
    )
    cut = [slice(None)] * data.ndim
    axes, steps = axes or list(range(len(starts))), steps or [1] * len(starts)
    for start, end, axis, step in zip(starts, ends, axes, steps, strict=True):
        # Backwards past the first: numpy would count an end of −n − 1 from the back again.
        end = None if step < 0 and end < -data.shape[axis] else end
        cut[axis] = slice(start, end, step)
    return [data[tuple(cut)]]


def _split(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    data, axis = inputs[0], attributes.get("axis", 0)
    sizes = whole_numbers(inputs, 1, attributes, "split")
    if not sizes:
        parts = attributes["num_outputs"]
        each = -(-data.shape[axis] // parts)  # the last one may be shorter
        return np.split(data, [each * part for part in range(1, parts)], axis=axis)
    if sum(sizes) != data.shape[axis]:
        raise ValueError("a split into other sizes than there are rows")
    return np.split(data, np.cumsum(sizes)[:-1], axis=axis)


def _squeeze(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    axes = whole_numbers(inputs, 1, attributes, "axes")
    return [np.squeeze(inputs[0], axis=tuple(axes) if axes else None)]


def _unsqueeze(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [np.expand_dims(inputs[0], tuple(whole_numbers(inputs, 1, attributes, "axes")))]


def _transpose(inputs: Inputs, attributes: Attributes) -> list[np.ndarray]:
    return [np.transpose(inputs[0], attributes.get("perm"))]


def _view(function: Function, shaping: tuple[int, ...]) -> Operator:
    """Make an operator that looks at its input another way: its outline is made by itself."""
    return Operator(function, function, shaping)


ARRANGEMENTS: Mapping[str, Operator] = MappingProxyType(
    {
        "Concat": Operator(_concat, _concat_outline),
        "Gather": Operator(_gather, _gather_outline),
        "Reshape": Operator(_reshape, _reshape_outline, shaping=(1,)),
        "Slice": _view(_slice, shaping=(1, 2, 3, 4)),
        "Split": _view(_split, shaping=(1,)),
        "Squeeze": _view(_squeeze, shaping=(1,)),
        "Transpose": _view(_transpose, shaping=()),
        "Unsqueeze": _view(_unsqueeze, shaping=(1,)),
    }
)
