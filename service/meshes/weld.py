"""Weld: join by position what a file format splits at its seams.

Formats store one vertex for each distinct set of attributes, so a UV seam or a hard edge looks like
a boundary, and refining that mesh would crack it. Every format is therefore welded by exact
position first, in the precision that the file stores (float32 in glTF and STL, double in OBJ and
OFF, either in PLY); attributes stay with the corners. What would move two vertices apart later
(morph deltas, a skin binding) keeps them apart here: closed lips are two lips.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from jaxtyping import Float, Int

from pns_common.mesh.reference_length import measure_reference_length
from pns_common.mesh.rows import distinct_rows, number_by_first_appearance

# Cells are counted in int64; a tolerance below this part of the largest coordinate joins nothing
# that float32 can tell apart.
SMALLEST_CELL = 1e-12
# Where the parts begin of what is one.
WHOLE = np.zeros(1, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Weld:
    """A welded mesh.

    Attributes:
        points: (V, 3) positions of the welded vertices.
        faces: (F, K) welded vertices, three of a triangle or one of a corner, numbered by first
            appearance over these corners.
        vertex_of: (N,) the welded vertex of each file vertex; −1 where no face uses it.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F K"]
    vertex_of: Int[np.ndarray, " N"]


def weld(
    positions: Float[np.ndarray, "N 3"],
    faces: Int[np.ndarray, "F K"],
    movement: Int[np.ndarray, " N"] | None = None,
) -> Weld:
    """Join the vertices whose positions are equal (−0 = 0), whatever lies near them.

    `movement` labels what else must be equal; None where nothing else moves a vertex.
    """
    positions = canonical_zero(positions)
    labels = distinct_rows(positions)
    if movement is not None:
        labels = distinct_rows(np.column_stack([labels, movement]))
    return weld_by_label(positions, faces, labels)


def weld_by_label(
    positions: Float[np.ndarray, "N 3"],
    faces: Int[np.ndarray, "F K"],
    labels: Int[np.ndarray, " N"],
) -> Weld:
    """Join the vertices that share a label, at the position of the first corner of each."""
    flat = faces.reshape(-1)
    group, first = number_by_first_appearance(labels[flat])
    points = np.take(positions, flat[first], axis=0).astype(np.float64)
    vertex_of = np.full(len(positions), -1, dtype=np.int64)
    vertex_of[flat] = group
    return Weld(points=points, faces=group.reshape(faces.shape), vertex_of=vertex_of)


def canonical_zero(values: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Write −0 as 0, so that equal numbers have equal bits."""
    return values + values.dtype.type(0)


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
