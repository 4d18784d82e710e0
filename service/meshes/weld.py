"""Weld: join by position what a file format splits at its seams.

Formats store one vertex for each distinct set of attributes, so a UV seam or a hard edge looks like
a boundary, and refining that mesh would crack it. Every format is therefore welded by exact
position first, in the precision that the file stores (float32 in glTF and STL, double in OBJ and
OFF, either in PLY); attributes stay with the corners. What would move two vertices apart later
(morph deltas, a skin binding) keeps them apart here: closed lips are two lips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.rows import distinct_rows, number_by_first_appearance


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
