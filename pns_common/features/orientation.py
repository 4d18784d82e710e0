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

from pns_common.connectivity.edge_order import OrderedEdges, first_face_order, left_face_order
from pns_common.connectivity.topology import Topology
from pns_common.geometry.frames import EdgeFrames, EdgeStencil, edge_frames, shut_where_degenerate


@dataclass(frozen=True)
class Orientation:
    """How interior edges are read: their order, and their frames."""

    order: Callable[[Topology, Int[np.ndarray, " N"]], OrderedEdges]
    frames: Callable[[EdgeStencil], EdgeFrames]


FIRST_FACE = Orientation(first_face_order, edge_frames)
SYMMETRIC = Orientation(left_face_order, shut_where_degenerate)
ORIENTATIONS: Mapping[str, Orientation] = MappingProxyType(
    {"first-face": FIRST_FACE, "symmetric": SYMMETRIC}
)
