"""The numbers that ``refine`` gives to new vertices, found without the whole mesh.

``refine`` numbers a level's edges by first appearance over its faces, and the descendants of a
control face are consecutive at every level. So an edge's number is the count of edges that control
faces before its own were first to show, and its place among those of its own: a sum over faces, and
a count in the part. Vertices are the control mesh's, then those of the control mesh's edges, then
those of the first level's edges, and so on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int

from pns_common.base.distinct import first_places
from pns_common.connectivity.doubled_faces import is_plain
from pns_common.connectivity.topology import Topology, build_topology
from pns_common.masks.linear import level_topologies
from pns_common.pieces import Piece

from .arrays import blocks_of, finished_array, let_go

BASES = "bases.npy"


def shown_first(piece: Piece, levels: int) -> Int[np.ndarray, "N L"]:
    """Count the edges of each level that the descendants of each own face are first to show.

    The faces at own faces' vertices must be there. Where no face repeats a vertex and no two have
    the same three, a face's children show the two halves of each edge that it showed, and the three
    edges inside: n_l+1 = 3 · 4^l + 2 n_l.
    """
    topology = build_topology(piece.faces, len(piece.points))
    shown = np.empty((int(piece.own.sum()), levels), dtype=np.int64)
    shown[:, 0] = _openers(topology, len(piece.faces))[piece.own]
    if levels > 1 and not is_plain(topology):
        finer = level_topologies(piece.faces, len(piece.points), levels)
        for level in range(1, levels):
            shown[:, level] = _openers(finer[level], len(piece.faces))[piece.own]
        return shown
    for level in range(1, levels):
        shown[:, level] = 3 * 4 ** (level - 1) + 2 * shown[:, level - 1]
    return shown


@dataclass(frozen=True, eq=False)
class Numbering:
    """Where each control face's edges begin, at each level.

    Attributes:
        bases: (L, F) edges of level l that faces before f are first to show.
        vertices: of each level, 0 … L, how many there are.
    """

    bases: Int[np.ndarray, "L F"]
    vertices: list[int]

    def of_edges(
        self,
        level: int,
        faces: Int[np.ndarray, " F"],
        openers: Int[np.ndarray, " E"],
    ) -> Int[np.ndarray, " E"]:
        """Return the vertices of a piece's edges of a level.

        They are sure where all faces of the edge are there.

        ``faces`` are the control mesh's numbers of the piece's; ``openers`` the piece's face that
        is first to show each edge, which ascends.
        """
        place = np.arange(len(openers)) - np.searchsorted(openers, openers)
        bases = self.bases[level][faces]
        return self.vertices[level] + bases[openers] + place


def write_bases(
    counted: Iterable[tuple[Int[np.ndarray, " N"], Int[np.ndarray, "N L"]]],
    vertices: int,
    faces: int,
    levels: int,
    folder: Path,
) -> list[int]:
    """Sum what all parts counted, each as faces and what they show, into ``folder``.

    Returns how many vertices each level has.
    """
    with finished_array(folder / BASES, (levels, faces), "<i8") as bases:
        for own, shown in counted:
            bases[:, own] = shown.T
            let_go(bases)
        counts = [vertices]
        for level in range(levels):
            total = 0
            for rows in blocks_of(faces):
                shown = bases[level, rows]
                ends = total + np.cumsum(shown)
                bases[level, rows] = ends - shown
                total = int(ends[-1])
                let_go(bases)
            counts.append(counts[-1] + total)
    return counts


def _openers(topology: Topology, control_faces: int) -> Int[np.ndarray, " F"]:
    """Count the edges that each control face's descendants are first to show."""
    first = first_places(topology.face_edges.reshape(-1), len(topology.edges))
    share = topology.face_edges.size // control_faces
    return np.bincount(first // share, minlength=control_faces)
