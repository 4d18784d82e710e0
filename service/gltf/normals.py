"""Normals and tangents of a refined mesh.

Normals are recomputed from the refined faces, weighted by the angle at the corner (Thürmer and
Wüthrich 1998), over the faces that shared a position and a normal before: a hard edge stays hard.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.arrays import cross, dot, norm, segment_sum, unit
from pns_common.blocks import Blocks

# A sum of unit normals times angles below this has no direction that could be trusted.
NO_DIRECTION = 1e-9


def angle_weighted_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    groups: Int[np.ndarray, "F 3"],
    fallback: Float[np.ndarray, "G 3"],
    blocks: Blocks,
) -> Float[np.ndarray, "G 3"]:
    """The unit normal of each group of corners.

    `groups` names the group of each face's corners; `fallback` is used where a group's faces have
    no area or cancel out.
    """
    weighted = np.empty((3, len(faces), 3))

    def block(rows: slice) -> None:
        a, b, c = (np.take(points, faces[rows, corner], axis=0) for corner in range(3))
        ab, bc, ca = b - a, c - b, a - c
        area_vector = cross(ab, -ca)
        normal, twice_area = unit(area_vector), norm(area_vector)
        for corner, cosine in enumerate([-dot(ab, ca), -dot(bc, ab), -dot(ca, bc)]):
            weighted[corner, rows] = np.arctan2(twice_area, cosine)[:, None] * normal

    blocks.run(len(faces), block)
    total = segment_sum(weighted.reshape(-1, 3), groups.T.reshape(-1), len(fallback))
    return np.where((norm(total) > NO_DIRECTION)[:, None], unit(total), safe_unit(fallback))


def safe_unit(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    """Rows scaled to length 1; the z axis where there is no direction."""
    return np.where((norm(vectors) > NO_DIRECTION)[:, None], unit(vectors), [0.0, 0.0, 1.0])


def perpendicular_tangents(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "N 3"]:
    """The tangents' unit projections onto the planes of the unit normals.

    Where a tangent lies along its normal, any perpendicular serves; this takes one from the axis
    that the normal is furthest from.
    """
    flat = tangents - dot(tangents, normals)[:, None] * normals
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    instead = axis - dot(axis, normals)[:, None] * normals
    lost = norm(flat) <= NO_DIRECTION * np.maximum(norm(tangents), NO_DIRECTION)
    return unit(np.where(lost[:, None], instead, flat))
