"""Normals at groups of corners, by kernels where they are loaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.base.in_order import InOrder
from pns_common.fused import fits, kernel_blocks, kernels_loaded
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.corner_normals import (
    add_corners,
    measure_triangles,
    normals_and_angles,
    scale_to_unit,
)
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
    total = np.zeros((count, 3))

    def add_up(measured: tuple[slice, np.ndarray]) -> None:
        rows, normals = measured
        add_corners(normals, groups, triangles, rows.start, rows.stop, total)

    # One thread adds up while others measure, in the order of faces: the sums are the same.
    sums = InOrder(add_up)

    def measure(rows: slice) -> None:
        normals = np.empty((6, each * (rows.stop - rows.start)))
        measure_triangles(points, faces, triangles, rows.start, rows.stop, normals)
        normals_and_angles(normals)
        sums.put(blocks.number(rows, len(faces)), (rows, normals))

    blocks.run(len(faces), measure)
    kernel_blocks(blocks.threads).run(count, scale_to_unit.over(ROWS, total))
    return total
