"""Hide the elements that are new inside a hidden face or on a hidden edge."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from pns_common.mesh.topology import Topology

from .shading import switch
from .snapshot import Layer

FACES, EDGES, POINTS = ".hide_poly", ".hide_edge", ".hide_vert"


def hide_within(
    layers: tuple[Layer, ...],
    topology: Topology,
    edges: Int[np.ndarray, "E 2"],
    inner: Bool[np.ndarray, " E"],
    old: int,
    count: int,
) -> tuple[Layer, ...]:
    """Hide what lies in hidden faces; old edges' halves and the ``old`` points stay as they are.

    ``inner`` are edges new inside a face, ``count`` is the number of all points. A new point shows
    where one of its edges does: Blender has no edge that shows between points that do not.
    """
    own = {layer.name: layer.values[:, 0].astype(bool) for layer in layers}
    if FACES not in own or not own[FACES].any():
        return layers
    face_of = np.zeros(len(edges), dtype=np.int64)
    face_of[topology.corner_edges] = topology.face_of(np.arange(len(topology.corners)))
    edge_hidden = own.get(EDGES, np.zeros(len(edges), bool)) | (inner & own[FACES][face_of])
    point_hidden = np.ones(count, dtype=bool)
    point_hidden[edges[~edge_hidden]] = False
    point_hidden[:old] = own.get(POINTS, np.zeros(count, bool))[:old]
    hidden = switch(EDGES, "EDGE", edge_hidden), switch(POINTS, "POINT", point_hidden)
    return (*(layer for layer in layers if layer.name not in (EDGES, POINTS)), *hidden)
