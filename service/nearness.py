"""Join what lies near: the weld for files whose seams do not quite meet."""

from __future__ import annotations

from itertools import product

import numpy as np
from jaxtyping import Float, Int

from pns_common.refine import measure_reference_length
from service.weld import Weld, distinct_rows, weld_by_label

# Cells are counted in int64; a tolerance below this part of the largest coordinate joins nothing
# that float32 can tell apart.
SMALLEST_CELL = 1e-12


def weld_within(
    welded: Weld, tolerance: float, unit: float | None, movement: Int[np.ndarray, " N"] | None
) -> Weld:
    """Join the vertices of a weld whose coordinates differ by less than `tolerance` times a unit.

    The unit is a length; None measures the mesh's own R. Joins follow one from another, and none
    joins two vertices directly that are more than twice as far apart on some axis. Vertices whose
    `movement` differs stay apart. The first vertex of each group gives the position.
    """
    if tolerance == 0 or not len(welded.faces):
        return welded
    length = measure_reference_length(welded.points, welded.faces) if unit is None else unit
    moved = np.zeros(len(welded.points), dtype=np.int64)
    used = welded.vertex_of >= 0
    if movement is not None:
        moved[welded.vertex_of[used]] = movement[used]
    joined = weld_by_label(
        welded.points, welded.faces, near_labels(welded.points, tolerance * length, moved)
    )
    vertex_of = np.where(used, joined.vertex_of[welded.vertex_of], -1)
    return Weld(points=joined.points, faces=joined.faces, vertex_of=vertex_of)


def near_labels(
    points: Float[np.ndarray, "V 3"], distance: float, apart: Int[np.ndarray, " V"]
) -> Int[np.ndarray, " V"]:
    """Labels that points share where all three coordinates differ by less than `distance`.

    Points in one cell of a grid, twice as wide, are joined, and so in the grids shifted by half a
    cell along each axis: two near points straddle a wall of one of the two at most. The cost does
    not depend on how many points crowd together.
    """
    low = points.min(axis=0)
    width = 2 * max(distance, SMALLEST_CELL * float(np.ptp(points, axis=0).max()))
    if width == 0:
        return distinct_rows(np.column_stack([points, apart.astype(np.float64)]))
    cells = []
    for shift in product((0.0, 0.5), repeat=3):
        number = np.floor((points - low) / width + shift).astype(np.int64)
        cells.append(distinct_rows(np.column_stack([number, apart])))
    return _connected(cells, len(points))


def _connected(partitions: list[Int[np.ndarray, " V"]], count: int) -> Int[np.ndarray, " V"]:
    """The components of points that share a part in any partition: the lowest index of each.

    Every root hooks on to the lowest root that it meets, and paths are cut short at once, so a
    long chain takes few rounds.
    """
    root = np.arange(count)
    while True:
        before = root
        for part in partitions:
            least = np.full(int(part.max()) + 1, count)
            np.minimum.at(least, part, root)
            parent = np.arange(count)
            np.minimum.at(parent, root, least[part])
            while not np.array_equal(parent, parent[parent]):
                parent = parent[parent]
            root = parent[root]
        if np.array_equal(root, before):
            return root
