"""Tangents at a right angle to normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import dot, norm, unit
from pns_common.base.blocks import Blocks
from pns_common.geometry.corner_normals import NO_DIRECTION


def perpendicular_tangents(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], blocks: Blocks
) -> Float[np.ndarray, "N 3"]:
    """Return the tangents' unit projections onto the planes of the unit normals.

    Where a tangent lies along its normal, any perpendicular serves; this takes one from the axis
    that the normal is furthest from.
    """
    made = np.empty_like(tangents)

    def turn(rows: slice) -> None:
        made[rows] = _turned(tangents[rows], normals[rows])

    blocks.run(len(made), turn)
    return made


def _turned(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    flat = tangents - dot(tangents, normals)[:, None] * normals
    lost = np.flatnonzero(norm(flat) <= NO_DIRECTION * np.maximum(norm(tangents), NO_DIRECTION))
    axis, normal = np.eye(3)[np.abs(normals[lost]).argmin(axis=1)], normals[lost]
    flat[lost] = axis - dot(axis, normal)[:, None] * normal
    return unit(flat)
