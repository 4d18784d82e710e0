"""Array helpers over the Python array API: the only module that may branch on a backend.

Geometry is written once for numpy (the product) and torch (training); index arrays are always
int64 numpy, because topology is built once per connectivity and never differentiated.
"""

from __future__ import annotations

from functools import cache
from typing import Any, TypeAlias

import numpy as np
from array_api_compat import array_namespace, is_torch_array
from jaxtyping import Bool, Float, Int, Shaped

# A numpy array or a torch tensor: no static type covers both.
Array: TypeAlias = Any


def namespace(*arrays: Array) -> Any:
    """Return the array-API namespace that the arrays share."""
    # Looking the namespace up costs as much as arithmetic on a hundred rows.
    if all(type(array) is np.ndarray for array in arrays):
        return _of_numpy()
    return array_namespace(*arrays)


@cache
def _of_numpy() -> Any:
    """Return numpy: a namespace itself from 2.1 on, before that with what stands in for one."""
    if np.lib.NumpyVersion(np.__version__) >= "2.1.0":
        return np
    import array_api_compat.numpy

    return array_api_compat.numpy


def beside(values: Array, constant: np.ndarray, dtype: Any = None) -> Array:
    """Return a numpy array as one of the kind of ``values``, and on its device."""
    if type(values) is np.ndarray:
        return constant if dtype is None else constant.astype(dtype, copy=False)
    # torch refuses to look at memory that is read-only or runs backwards: only that is copied.
    kept = np.require(constant, requirements=["C", "W"])
    return namespace(values).asarray(kept, dtype=dtype, device=values.device)


def gather(values: Array, indices: Int[np.ndarray, "..."]) -> Array:
    """Return the rows of ``values`` at ``indices``: shape ``indices.shape + values.shape[1:]``."""
    xp = namespace(values)
    if is_torch_array(values):
        flat = beside(values, indices.reshape(-1))
        rows = xp.take(values, flat, axis=0)
        return xp.reshape(rows, indices.shape + tuple(values.shape[1:]))
    # np.take is four times as fast as fancy indexing on rows of three.
    return np.take(values, indices, axis=0)


def segment_sum(
    values: Float[Array, "N K"], segments: Int[np.ndarray, " N"], count: int
) -> Float[Array, "S K"]:
    """Sum the rows of ``values`` that share a segment, in row order (so the bits are fixed)."""
    if is_torch_array(values):
        xp = namespace(values)
        zeros = xp.zeros((count, values.shape[1]), dtype=values.dtype, device=values.device)
        return zeros.index_add(0, beside(values, segments), values)
    columns = [np.bincount(segments, column, count) for column in values.T]
    return np.stack(columns, axis=1).astype(values.dtype, copy=False)


def scatter(
    values: Shaped[Array, " N *K"], rows: Int[np.ndarray, " N"], count: int
) -> Shaped[Array, " S *K"]:
    """Return ``count`` rows: ``values`` at ``rows``, each named once, and 0 elsewhere."""
    shape = (count, *values.shape[1:])
    if is_torch_array(values):
        zeros = values.new_zeros(shape)
        return zeros.index_copy(0, beside(values, rows), values)
    spread = np.zeros(shape, dtype=values.dtype)
    spread[rows] = values
    return spread


def marked(rows: Int[np.ndarray, " N"], count: int) -> Bool[np.ndarray, " S"]:
    """Return which of ``count`` rows are named, however often."""
    marks = np.zeros(count, dtype=bool)
    marks[rows] = True
    return marks


def detached(values: Array) -> Array:
    """Return the same numbers, through which no gradient passes."""
    return values.detach() if is_torch_array(values) else values


def as_numpy(values: Array) -> np.ndarray:
    """Return the same numbers as a numpy array, without a gradient."""
    return values.detach().cpu().numpy() if is_torch_array(values) else values


def dot(u: Float[Array, "*#N 3"], v: Float[Array, "*#N 3"]) -> Float[Array, "*#N"]:
    """Return the inner products of vectors, summed in a fixed order."""
    return u[..., 0] * v[..., 0] + u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]


def cross(u: Float[Array, "N 3"], v: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return the row-wise cross product (written out: np.cross spends most time on axes)."""
    xp = namespace(u, v)
    return xp.stack(
        [
            u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
            u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
            u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
        ],
        axis=-1,
    )


def norm(v: Float[Array, "N 3"]) -> Float[Array, " N"]:
    """Return the row-wise Euclidean length, with gradient 0 (not NaN) at zero vectors."""
    xp = namespace(v)
    square = dot(v, v)
    positive = square > 0
    return xp.where(positive, xp.sqrt(xp.where(positive, square, 1.0)), 0.0)


def unit(v: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Scale rows to length 1; zero rows stay zero."""
    return unit_longer_than(v, 0.0)


def unit_longer_than(
    v: Float[Array, "N 3"], shortest: Float[Array, " N"] | float
) -> Float[Array, "N 3"]:
    """Scale rows longer than ``shortest`` to length 1; all others become zero."""
    xp = namespace(v)
    square = dot(v, v)
    long = square > shortest * shortest
    # Divide, not multiply by the inverse: on an axis-aligned plane z / √(z²) is exactly 1.
    return v / xp.where(long, xp.sqrt(xp.where(long, square, 1.0)), xp.inf)[:, None]
