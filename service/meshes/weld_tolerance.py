"""Join what lies near: the weld for files whose seams do not quite meet."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
from jaxtyping import Float, Int

from pns_common.reference_length import measure_reference_length
from pns_common.rows import distinct_rows

from .weld import Weld, weld_by_label

# Cells are counted in int64; a tolerance below this part of the largest coordinate joins nothing
# that float32 can tell apart.
SMALLEST_CELL = 1e-12
# Where the parts begin of what is one.
WHOLE = np.zeros(1, dtype=np.int64)


def weld_within(
    welded: Weld,
    tolerance: float,
    unit: float | None,
    movement: Int[np.ndarray, " N"] | None,
    part_faces: Int[np.ndarray, " P"] = WHOLE,
) -> Weld:
    """Join the vertices of a weld whose coordinates differ by less than `tolerance` times a unit.

    The unit is a length; None measures the mesh's own R. Joins follow one from another, and none
    joins two vertices directly that are more than twice as far apart on some axis. Vertices whose
    `movement` differs stay apart. The first vertex of each group gives the position. `part_faces`
    is where the faces of each part begin, for meshes of several, which share no vertex: each is
    joined as if it were alone.
    """
    if tolerance == 0 or not len(welded.faces):
        return welded
    first = np.minimum.reduceat(welded.faces.min(axis=1), part_faces)
    lengths = _reference_lengths(welded, part_faces, first) if unit is None else np.full(1, unit)
    moved = np.zeros(len(welded.points), dtype=np.int64)
    used = welded.vertex_of >= 0
    if movement is not None:
        moved[welded.vertex_of[used]] = movement[used]
    labels = near_labels(welded.points, tolerance * lengths, moved, first)
    joined = weld_by_label(welded.points, welded.faces, labels)
    vertex_of = np.where(used, joined.vertex_of[welded.vertex_of], -1)
    return Weld(points=joined.points, faces=joined.faces, vertex_of=vertex_of)


def _reference_lengths(
    welded: Weld, part_faces: Int[np.ndarray, " P"], first: Int[np.ndarray, " P"]
) -> Float[np.ndarray, " P"]:
    """Return each part's own R."""
    ends = zip(
        pairwise([*part_faces, len(welded.faces)]),
        pairwise([*first, len(welded.points)]),
        strict=True,
    )
    return np.array(
        [
            measure_reference_length(
                welded.points[start:stop], welded.faces[begin:end].reshape(-1) - start
            )
            for (begin, end), (start, stop) in ends
        ]
    )


def near_labels(
    points: Float[np.ndarray, "V 3"],
    distance: float | Float[np.ndarray, " P"],
    apart: Int[np.ndarray, " V"],
    first: Int[np.ndarray, " P"] = WHOLE,
) -> Int[np.ndarray, " V"]:
    """Return labels that points share where all three coordinates differ by less than `distance`.

    Points in one cell of a grid, twice as wide, are joined, and so in the grids shifted by half a
    cell along each axis: two near points straddle a wall of one of the two at most. The cost does
    not depend on how many points crowd together. Each of the parts, whose points begin at `first`,
    has a grid of its own.
    """
    lowest = np.minimum.reduceat(points, first)
    spread = (np.maximum.reduceat(points, first) - lowest).max(axis=1)
    widths = 2 * np.maximum(distance, SMALLEST_CELL * spread)
    # Where there is no width, all points of the part are one.
    widths = np.where(widths > 0, widths, 1.0)
    counts = np.diff([*first, len(points)])
    low, width = np.repeat(lowest, counts, axis=0), np.repeat(widths, counts)[:, None]
    cells = []
    for shift in product((0.0, 0.5), repeat=3):
        number = np.floor((points - low) / width + shift).astype(np.int64)
        cells.append(distinct_rows(np.column_stack([number, apart])))
    return _connected(cells, len(points))


def _connected(partitions: list[Int[np.ndarray, " V"]], count: int) -> Int[np.ndarray, " V"]:
    """Label components of points that share a part in any partition: by the lowest index of each.

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
