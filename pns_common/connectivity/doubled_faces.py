"""Faces that lie on each other: with the three vertices of another face, or one of them twice.

What they are split into has edges that no other split makes: those between the middles of their
sides, where all their children meet. So the middle of such a side is not regular as others are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import EdgeClass, Topology, stable_sort
from pns_common.mesh import repeated_vertex


@dataclass(frozen=True, eq=False)
class DoubledFaces:
    """Where faces of a mesh lie on each other, and what their sides are.

    In the split two edges lead from the middle of a doubled face's side to those of its other
    sides, each with twice as many half-edges as faces lie there: they are sharp.

    Attributes:
        doubled: the faces that have three vertices, and these with another face.
        folds: sides of theirs that are interior: both their faces have the same three vertices.
        corners: all others of their sides, whose halves are sharp too.
        collapsed: the faces that have a vertex twice.
    """

    doubled: Bool[np.ndarray, " F"]
    folds: Bool[np.ndarray, " E"]
    corners: Bool[np.ndarray, " E"]
    collapsed: Int[np.ndarray, " N"]


def is_plain(topology: Topology) -> bool:
    """Return whether no face has a vertex twice and no two have the same three."""
    if repeated_vertex(topology.faces).any():
        return False
    # Two faces with two sides in common have all three.
    sides = np.sort(topology.face_edges, axis=1)
    pairs = np.sort(sides[:, 0] * np.int64(len(topology.edges)) + sides[:, 1])
    return not (pairs[1:] == pairs[:-1]).any()


def doubled_faces(topology: Topology) -> DoubledFaces | None:
    """Return where faces lie on each other; None where none do."""
    # Two faces on one edge lie on each other where both have one vertex opposite; where more do,
    # or faces of less than three vertices, no edge of theirs is interior.
    opposite = topology.stencil[:, 2:]
    could = topology.edge_class == int(EdgeClass.IRREGULAR)
    could |= (opposite[:, 0] == opposite[:, 1]) & (opposite[:, 0] >= 0)
    if not could.any():
        return None
    rows = np.flatnonzero(could[topology.face_edges].all(axis=1))
    twice = repeated_vertex(topology.faces[rows])
    collapsed, rows = rows[twice], rows[~twice]
    # Two sides of three tell which vertices a face has.
    sides = np.sort(topology.face_edges[rows], axis=1)
    key, order = stable_sort(sides[:, 0] * np.int64(len(topology.edges)) + sides[:, 1])
    # Whether the face before lies on this one, and after the last none.
    again = np.zeros(len(key) + 1, dtype=bool)
    again[1:-1] = key[1:] == key[:-1]
    doubled = rows[order[again[:-1] | again[1:]]]
    if len(doubled) + len(collapsed) == 0:
        return None
    is_side = marked(topology.face_edges[doubled].reshape(-1), len(topology.edges))
    interior = topology.edge_class == int(EdgeClass.INTERIOR)
    return DoubledFaces(
        doubled=marked(doubled, len(topology.faces)),
        folds=is_side & interior,
        corners=is_side & ~interior,
        collapsed=collapsed,
    )
