"""What a file's normals say of its edges: smooth where two faces share them, hard where not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import next_corner
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .joined_normals import NO_NORMAL


@dataclass(frozen=True, eq=False)
class EdgeShading:
    """The I interior edges of a mesh to refine, as its file shades them.

    Attributes:
        edges: pairs of vertices, the lower first.
        faces: the two faces of each.
        hard: whether the faces carry different normals at both ends. At both: the sides of a cone
            share the normals along its base and part at its tip alone, and they are smooth.
        smooth: whether they carry the same at both ends. Corners say nothing that have no normal,
            or one without direction.
    """

    edges: Int[np.ndarray, "I 2"]
    faces: Int[np.ndarray, "I 2"]
    hard: Bool[np.ndarray, " I"]
    smooth: Bool[np.ndarray, " I"]


def hard_edges(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose two faces carry different normals at both ends."""
    labels = corner_labels(control, cleaned)
    shading = shading_of(cleaned, labels, without_one_normal(cleaned, labels))
    # Of one type, whoever found them.
    return shading.edges[shading.hard].astype(np.int64)


def corner_labels(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, "F 3"]:
    """Label the corners of the mesh to refine: equal normals at one vertex share a number."""
    return control.of_cleaned(cleaned, _labels_of_faces(control))


def without_one_normal(cleaned: Cleaned, labels: Int[np.ndarray, "F 3"]) -> Bool[np.ndarray, " V"]:
    """Return the vertices whose corners carry several normals, or not all of them one."""
    faces, label = cleaned.mesh.faces.reshape(-1), labels.reshape(-1)
    of_vertex = np.empty(len(cleaned.mesh.vertices), dtype=label.dtype)
    of_vertex[faces] = label
    others = (of_vertex[faces] != label) | (label == NO_NORMAL)
    return marked(faces[others], len(of_vertex))


def shading_of(
    cleaned: Cleaned, labels: Int[np.ndarray, "F 3"], parted: Bool[np.ndarray, " V"]
) -> EdgeShading:
    """Return what the labels of its corners say of a mesh's edges.

    ``parted`` are the vertices without one normal.
    """
    label = labels.reshape(-1)
    edges, half_edges = interior_edges(cleaned.mesh.faces, len(cleaned.mesh.vertices))
    hard, smooth = np.zeros(len(edges), dtype=bool), np.ones(len(edges), dtype=bool)
    # Most edges run between vertices with one normal each, and are smooth.
    asked = np.flatnonzero(parted[edges].any(axis=1))
    hard[asked] = True
    there, back = half_edges[asked].T
    for corners, facing in ((there, next_corner(back)), (next_corner(there), back)):
        first, second = label[corners], label[facing]
        known = (first != NO_NORMAL) & (second != NO_NORMAL)
        hard[asked] &= known & (first != second)
        smooth[asked] &= known & (first == second)
    return EdgeShading(edges, half_edges // 3, hard, smooth)


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
