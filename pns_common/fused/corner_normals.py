"""Normals at groups of corners, by kernels where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused import fits, kernels_loaded
from pns_common.fused.kernels.corner_normals import face_normals, scale_to_unit, sum_corners
from pns_common.geometry import corner_normals


def angle_weighted_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    groups: Int[np.ndarray, "F 3"],
    count: int,
    blocks: Blocks,
) -> Float[np.ndarray, "G 3"]:
    """Return what ``pns_common.geometry.corner_normals`` makes, bit for bit.

    The kernels do it in a fifth of the time; they are not loaded for this.
    """
    if not (kernels_loaded() and fits(max(len(points), count), len(faces), 1)):
        return corner_normals.angle_weighted_normals(points, faces, groups, count, blocks)
    points = np.ascontiguousarray(points)
    faces, groups = (np.ascontiguousarray(each, dtype=np.int32) for each in (faces, groups))
    normals, angles = np.empty((len(faces), 3)), np.empty((2, len(faces)))

    def measure(rows: slice) -> None:
        sides = np.empty((3, rows.stop - rows.start))
        face_normals(points, faces, rows.start, rows.stop, normals, sides)
        # By numpy, whose bits no other arctangent has.
        np.arctan2(sides[0], sides[1:], out=angles[:, rows])

    blocks.run(len(faces), measure)
    total = np.zeros((count, 3))
    sum_corners(normals, angles, groups, total)
    blocks.unheard().run(count, lambda rows: scale_to_unit(rows.start, rows.stop, total))
    return total
