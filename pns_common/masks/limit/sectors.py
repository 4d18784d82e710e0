"""Sectors: the corners around a vertex between two sharp edges, in anticlockwise order.

A vertex without sharp edges has one closed sector for each of its fans; a vertex on a boundary or a
crease has open ones, and a surface normal in each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import Topology, across_from_corners


@dataclass(frozen=True, eq=False)
class Sectors:
    """The sectors of a mesh; corner 3 f + i is corner i of face f.

    Attributes:
        of_corner: the sector of each corner.
        rank: its place there, anticlockwise from 0.
        last: whether it is the last of an open sector.
        vertex: of each sector.
        size: how many corners.
        closed: whether the last corner is followed by the first.
    """

    of_corner: Int[np.ndarray, " C"]
    rank: Int[np.ndarray, " C"]
    last: Bool[np.ndarray, " C"]
    vertex: Int[np.ndarray, " S"]
    size: Int[np.ndarray, " S"]
    closed: Bool[np.ndarray, " S"]


def sectors(topology: Topology) -> Sectors:
    """Find the sectors, by pointer doubling from corner to corner across interior edges."""
    before = across_from_corners(topology, topology.interior)
    corners = np.arange(len(before))
    rounds = int(np.bincount(topology.faces.reshape(-1)).max()).bit_length()
    # A closed sector never runs out; it is opened before its lowest corner.
    label, hop = corners.copy(), before.copy()
    for _ in range(rounds):
        label = np.minimum(label, label[np.where(hop >= 0, hop, corners)])
        hop = np.where(hop >= 0, hop[hop], -1)
    is_closed = hop >= 0
    follows = marked(before[before >= 0], len(before))
    before[is_closed & (label == corners)] = -1

    rank = (before >= 0).astype(np.int64)
    root = np.where(before >= 0, before, corners)
    for _ in range(rounds):
        rank += rank[root]
        root = root[root]
    first = np.flatnonzero(before < 0)
    number = np.zeros(len(before), dtype=np.int64)
    number[first] = np.arange(len(first))
    of_corner = number[root]
    return Sectors(
        of_corner=of_corner,
        rank=rank,
        last=~is_closed & ~follows,
        vertex=topology.faces.reshape(-1)[first],
        size=np.bincount(of_corner, minlength=len(first)),
        closed=is_closed[first],
    )
