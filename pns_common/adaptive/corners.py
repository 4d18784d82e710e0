"""Values of corners at faces of several levels, linear in each control face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Integer, Shaped

from pns_common.mesh.rows import distinct_rows, number_by_first_appearance

# Weights are whole multiples of 2⁻¹⁶ at all levels that there are.
UNITS = 2**16


@dataclass(frozen=True, eq=False)
class Blend:
    """New rows made of three old ones each.

    Attributes:
        rows: (N, 3) old rows; may be any where the weight is 0.
        weights: (N, 3) their weights, of sum 1.
    """

    rows: Integer[np.ndarray, "N 3"]
    weights: Float[np.ndarray, "N 3"]

    def linear(self, values: Shaped[np.ndarray, "C K"]) -> Float[np.ndarray, "N K"]:
        """Return weighted means."""
        return np.einsum("nk,nkj->nj", self.weights, values[self.rows].astype(np.float64))

    def nearest(self, values: Shaped[np.ndarray, "C K"]) -> Shaped[np.ndarray, "N K"]:
        """Return values of the rows of the largest weight; of equals the first."""
        nearest = self.weights.argmax(axis=1)[:, None]
        return values[np.take_along_axis(self.rows, nearest, axis=1)[:, 0]]


@dataclass(frozen=True, eq=False)
class Joined:
    """Corners of faces, of which those of one vertex that are made of the same rows are one.

    Attributes:
        faces: (F, 3) the new row at each corner.
        vertex: (N,) the vertex of each row.
        blend: what each row is made of.
    """

    faces: Integer[np.ndarray, "F 3"]
    vertex: Integer[np.ndarray, " N"]
    blend: Blend


def join_corners(
    vertices: Integer[np.ndarray, "F 3"],
    rows: Integer[np.ndarray, "F 3"],
    weights: Float[np.ndarray, "F 3 3"],
) -> Joined:
    """Join corners of faces that are alike.

    Args:
        vertices: the vertex at each corner.
        rows: the old rows at the corners of each face's control face.
        weights: their weights at each corner, as of ``AdaptiveRefinement``.
    """
    flat, each = vertices.reshape(-1).astype(np.int64), weights.reshape(-1, 3)
    of_corner = rows.astype(np.int64).repeat(3, axis=0)
    shares = np.rint(each * UNITS).astype(np.int64)
    made_of = np.sort(np.where(shares > 0, of_corner * 2 * UNITS + shares, -1), axis=1)
    keys = distinct_rows(np.column_stack([flat, made_of]))
    number, first = number_by_first_appearance(keys)
    return Joined(number.reshape(-1, 3), flat[first], Blend(of_corner[first], each[first]))
