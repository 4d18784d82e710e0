"""Directions of normals and tangents."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import dot, norm, unit
from pns_common.geometry.corner_normals import NO_DIRECTION


def safe_unit(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Scale rows to length 1; the z axis where there is no direction."""
    return np.where((norm(vectors) > NO_DIRECTION)[:, None], unit(vectors), [0.0, 0.0, 1.0])


def perpendicular_tangents(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    """Return the tangents' unit projections onto the planes of the unit normals.

    Where a tangent lies along its normal, any perpendicular serves; this takes one from the axis
    that the normal is furthest from.
    """
    flat = tangents - dot(tangents, normals)[:, None] * normals
    lost = np.flatnonzero(norm(flat) <= NO_DIRECTION * np.maximum(norm(tangents), NO_DIRECTION))
    axis, normal = np.eye(3)[np.abs(normals[lost]).argmin(axis=1)], normals[lost]
    flat[lost] = axis - dot(axis, normal)[:, None] * normal
    return unit(flat)
