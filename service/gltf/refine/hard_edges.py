"""Edges that a file's normals make hard."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import next_corner
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .joined_normals import NO_NORMAL


def hard_edges(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose two faces carry different normals at both ends.

    Pairs of vertices of the mesh to refine, the lower first. Both ends count: the sides of a cone
    share the normals along its base and differ at its tip alone, and the cone is smooth. A corner
    without a normal, or with one of length 0, makes no edge hard.
    """
    # Corners with equal normals at one vertex share a number.
    label = control.of_cleaned(cleaned, _labels_of_faces(control)).reshape(-1)
    vertex = cleaned.mesh.faces.reshape(-1)
    of_vertex = np.empty(len(cleaned.mesh.vertices), dtype=label.dtype)
    of_vertex[vertex] = label
    several = marked(vertex[of_vertex[vertex] != label], len(of_vertex))
    edges, half_edges = interior_edges(cleaned.mesh.faces, len(of_vertex))
    asked = np.flatnonzero(several[edges].all(axis=1))
    hard = np.ones(len(asked), dtype=bool)
    there, back = half_edges[asked].T
    for corners, facing in ((there, next_corner(back)), (next_corner(there), back)):
        first, second = label[corners], label[facing]
        hard &= (first != NO_NORMAL) & (second != NO_NORMAL) & (first != second)
    return edges[asked[hard]].astype(np.int64)


def _labels_of_faces(control: ControlMesh) -> Int[np.ndarray, "P 3"]:
    """Label each corner of each proper face of the file."""
    labels = control.normal_labels.copy()
    for primitive, part in zip(control.primitives, control.rows, strict=True):
        if "NORMAL" in primitive.attributes:
            labels[part][~primitive.attributes["NORMAL"].any(axis=1)] = NO_NORMAL
    return np.concatenate(
        [
            labels[primitive.corners[keep] + part.start]
            for primitive, keep, part in zip(
                control.primitives, control.kept, control.rows, strict=True
            )
        ]
    )
