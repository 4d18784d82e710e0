"""Which end of an edge is a, which side is c, and what happens where there is no frame.

``first-face`` is the paper's: c lies in the face of lower index, so the result depends on the order
of the faces; degenerate edges take a frame of world axes.

``symmetric``: c lies in the face to the left of a → b. What is left of the ambiguity is a symmetry
of the stencil, over which the model file averages its network; degenerate edges are not corrected.
So the result depends on no numbering.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Int

from pns_common.frames import EdgeFrames, EdgeStencil, edge_frames, shut_where_degenerate
from pns_common.topology import Topology


@dataclass(frozen=True, eq=False)
class OrderedEdges:
    """Vertices a, b, c, d of N interior edges, and the faces of c and of d."""

    stencil: Int[np.ndarray, "N 4"]
    faces: Int[np.ndarray, "N 2"]


@dataclass(frozen=True)
class Orientation:
    """How interior edges are read: their order, and their frames."""

    order: Callable[[Topology, Int[np.ndarray, " N"]], OrderedEdges]
    frames: Callable[[EdgeStencil], EdgeFrames]


def first_face_order(topology: Topology, edges: Int[np.ndarray, " N"]) -> OrderedEdges:
    """c in the face of lower index, d in the other."""
    return OrderedEdges(topology.stencil[edges], topology.half_edges[edges] // 3)


def left_face_order(topology: Topology, edges: Int[np.ndarray, " N"]) -> OrderedEdges:
    """c in the face to the left of a → b, seen from outside: the one that runs from a to b."""
    first = first_face_order(topology, edges)
    start = np.take(topology.faces, topology.half_edges[edges, 0])
    right = (start != first.stencil[:, 0])[:, None]
    return OrderedEdges(
        stencil=np.where(right, first.stencil[:, [0, 1, 3, 2]], first.stencil),
        faces=np.where(right, first.faces[:, ::-1], first.faces),
    )


FIRST_FACE = Orientation(first_face_order, edge_frames)
SYMMETRIC = Orientation(left_face_order, shut_where_degenerate)
ORIENTATIONS: Mapping[str, Orientation] = MappingProxyType(
    {"first-face": FIRST_FACE, "symmetric": SYMMETRIC}
)
