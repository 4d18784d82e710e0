"""Creases: interior edges that are kept sharp, named or found, and followed through the levels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Int

from pns_common.base.arrays import marked
from pns_common.base.parameters import is_bool, is_number, is_whole
from pns_common.connectivity.topology import EdgeClass, Topology
from pns_common.errors import ParameterError


@dataclass(frozen=True, eq=False)
class Creases:
    """Which edges of a control mesh are kept sharp.

    Attributes:
        named: pairs of vertices.
        line_angle: θ in degrees of the crease lines that the mesh shows
            (geometry/crease_lines); None: none are looked for.
        edged_angle: θ' of gentler lines, of edged meshes and beside plane sides, in degrees
            below θ; None: there are none.
        edged: whether it is an edged mesh, where that is known of the whole; None: that is seen.
        levels: at how many levels they are sharp, and smooth from then on (semi-sharp creases,
            DeRose, Kass and Truong 1998); None: for good. Where they are sharp at the last level,
            limits take them as sharp for good.

    Raises:
        ParameterError: those named are no pairs of whole numbers; an angle, the levels or `edged`
            are out of range.
    """

    named: Int[np.ndarray, "N 2"] | None = None
    line_angle: float | None = None
    levels: int | None = None
    edged_angle: float | None = None
    edged: bool | None = None

    def __post_init__(self) -> None:
        angle, levels = self.line_angle, self.levels
        if self.named is not None:
            object.__setattr__(self, "named", as_pairs(self.named))
        if angle is not None and not (is_number(angle) and 0 < angle < 180):
            raise ParameterError("line_angle", angle, expected="degrees between 0 and 180")
        gentle = self.edged_angle
        if gentle is not None and not (is_number(gentle) and 0 < gentle < (angle or 0)):
            raise ParameterError("edged_angle", gentle, expected="degrees between 0 and line_angle")
        if levels is not None and not (is_whole(levels) and levels >= 1):
            raise ParameterError("levels", levels, expected="a whole number, at least 1")
        if self.edged is not None and not is_bool(self.edged):
            raise ParameterError("edged", self.edged, expected="True, False or None")

    def with_named(self, pairs: Int[np.ndarray, "N 2"]) -> Creases:
        """Return the same with further pairs of vertices named."""
        if len(pairs) == 0:
            return self
        named = pairs if self.named is None else np.concatenate([pairs, self.named])
        return replace(self, named=named)

    def sharp_at(self, depth: int) -> bool:
        """Return whether they are sharp at a level; 0 is the control mesh's."""
        return self.levels is None or depth < self.levels

    def left_after(self, levels: int) -> Int[np.ndarray, "N 2"] | None:
        """Return those named that are sharp at the last of so many levels."""
        return self.named if self.sharp_at(levels - 1) else None


NO_CREASES = Creases()


def with_crease_rows(topology: Topology, rows: Int[np.ndarray, " N"]) -> Topology:
    """Return the topology with some interior edges as creases."""
    edge_class = topology.edge_class.copy()
    edge_class[rows] = EdgeClass.CREASE
    interior = np.flatnonzero(edge_class == EdgeClass.INTERIOR)
    return replace(topology, edge_class=edge_class, interior=interior)


def with_creases(topology: Topology, creases: Int[np.ndarray, "N 2"] | None) -> Topology:
    """Return the topology with those interior edges as creases that the vertex pairs name.

    Raises:
        ParameterError: a pair is no edge of the mesh.
    """
    if creases is None:
        return topology
    edge_class = crease_classes(topology.edges, topology.edge_class, topology.vertex_count, creases)
    interior = np.flatnonzero(edge_class == EdgeClass.INTERIOR)
    return replace(topology, edge_class=edge_class, interior=interior)


def crease_classes(
    edges: Int[np.ndarray, "E 2"],
    edge_class: Int[np.ndarray, " E"],
    vertex_count: int,
    creases: Int[np.ndarray, "N 2"],
) -> Int[np.ndarray, " E"]:
    """Return the classes of the edges; interior ones that the vertex pairs name are creases.

    Raises:
        ParameterError: a pair is no edge.
    """
    named = checked_pairs(creases, vertex_count)
    if len(named) == 0:
        return edge_class
    # Few edges have both ends at creases: all others need no look.
    at_creases = marked(named.reshape(-1), vertex_count)
    rows = np.flatnonzero(at_creases[edges[:, 0]] & at_creases[edges[:, 1]])
    keys, named_keys = (pair_keys(pairs, vertex_count) for pairs in (edges[rows], named))
    lost = np.flatnonzero(~np.isin(named_keys, keys))
    if len(lost):
        row = int(lost[0])
        raise ParameterError(f"creases[{row}]", named[row].tolist(), expected="an edge of the mesh")
    rows = rows[np.isin(keys, named_keys)]
    kept = edge_class.copy()
    kept[rows[kept[rows] == EdgeClass.INTERIOR]] = EdgeClass.CREASE
    return kept


def pair_keys(pairs: Int[np.ndarray, "N 2"], vertex_count: int) -> Int[np.ndarray, " N"]:
    """Return one number for each pair of vertices, whichever comes first."""
    pairs = pairs.astype(np.int64)
    return pairs.min(axis=1) * vertex_count + pairs.max(axis=1)


def crease_children(topology: Topology) -> Int[np.ndarray, "N 2"]:
    """Return the halves of the crease edges, as vertex pairs of the split mesh."""
    return crease_halves(topology.edges, topology.edge_class, topology.vertex_count)


def crease_halves(
    edges: Int[np.ndarray, "E 2"], edge_class: Int[np.ndarray, " E"], vertex_count: int
) -> Int[np.ndarray, "N 2"]:
    """Return the same from the arrays."""
    creases = np.flatnonzero(edge_class == EdgeClass.CREASE)
    middle = vertex_count + creases
    return np.stack([edges[creases], np.stack([middle, middle], axis=1)], axis=-1).reshape(-1, 2)


def as_pairs(creases: Any) -> Int[np.ndarray, "N 2"]:
    """Return a copy of creases as rows of two whole numbers, whatever they number.

    Raises:
        ParameterError: they are something else.
    """
    # numpy would read what lies under the mask.
    if np.ma.is_masked(creases):
        raise ParameterError("creases.mask", True, expected="no masked values")
    try:
        pairs = np.asarray(creases)
    except ValueError as error:  # rows differ in length
        row = next(row for row, pair in enumerate(creases) if not _is_pair(pair))
        raise ParameterError(f"creases[{row}]", creases[row], expected="two vertices") from error
    if pairs.size == 0 and pairs.ndim in (1, 2):
        # An empty list has no integers to tell it from one of floats.
        return np.zeros((0, 2), dtype=np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        expected = "(N, 2): a row of two vertices for each edge"
        raise ParameterError("creases.shape", pairs.shape, expected=expected)
    if pairs.dtype.kind not in "iu":
        expected = "whole numbers of an integer type"
        raise ParameterError("creases.dtype", str(pairs.dtype), expected=expected)
    # Before the cast: 2⁶⁴ − 1 would become −1.
    huge = np.flatnonzero((pairs > np.iinfo(np.int64).max).any(axis=1))
    if len(huge):
        row = int(huge[0])
        raise ParameterError(f"creases[{row}]", pairs[row].tolist(), expected="two vertices")
    return pairs.astype(np.int64)


def _is_pair(row: Any) -> bool:
    try:
        return np.shape(row) == (2,)
    except ValueError:  # it holds rows that differ in length
        return False


def checked_pairs(creases: Int[np.ndarray, "N 2"], vertex_count: int) -> Int[np.ndarray, "N 2"]:
    """Return creases, refused unless they are pairs of vertices.

    Raises:
        ParameterError: they are not.
    """
    pairs = as_pairs(creases)
    outside = np.flatnonzero(((pairs < 0) | (pairs >= vertex_count)).any(axis=1))
    if len(outside):
        row = int(outside[0])
        expected = f"vertices 0 … {vertex_count - 1}"
        raise ParameterError(f"creases[{row}]", pairs[row].tolist(), expected=expected)
    return pairs
