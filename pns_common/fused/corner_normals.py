"""Normals at groups of corners, by kernels where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused import fits, kernels_loaded
from pns_common.fused.kernels.angles import corner_angles
from pns_common.fused.kernels.corner_normals import scale_to_unit, sum_corners, triangle_normals
from pns_common.fused.loop_points import owners
from pns_common.geometry import corner_normals


def angle_weighted_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F T"],
    groups: Int[np.ndarray, "F T"],
    count: int,
    blocks: Blocks,
    triangles: Int[np.ndarray, "D 3"] = corner_normals.ONE_TRIANGLE,
) -> Float[np.ndarray, "G 3"]:
    """Return what ``pns_common.geometry.corner_normals`` makes, bit for bit.

    The kernels do it in a tenth of the time; they are not loaded for this.
    """
    each = len(triangles)
    if not (kernels_loaded() and fits(max(len(points), count), each * len(faces), 1)):
        return corner_normals.angle_weighted_normals(
            points, faces, groups, count, blocks, triangles
        )
    points = np.ascontiguousarray(points)
    faces, groups, triangles = (
        np.ascontiguousarray(indices, dtype=np.int32) for indices in (faces, groups, triangles)
    )
    normals, angles = np.empty((each * len(faces), 3)), np.empty((2, each * len(faces)))

    def measure(rows: slice) -> None:
        made = slice(each * rows.start, each * rows.stop)
        sides = np.empty((3, made.stop - made.start))
        triangle_normals(points, faces, triangles, rows.start, rows.stop, normals[made], sides)
        corner_angles(sides, made.start, angles)

    blocks.run(len(faces), measure)
    total = np.zeros((count, 3))

    def add_up(rows: slice) -> None:
        sum_corners(normals, angles, groups, triangles, rows.start, rows.stop, total)
        scale_to_unit(rows.start, rows.stop, total)

    owners(blocks.unheard(), count).run(count, add_up)
    return total
