"""Which edges of a glTF mesh are creases: those whose two sides carry different normals."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.connectivity.topology import build_topology, next_corner
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .smoothing import joined_normals

_NO_NORMAL = -1


def hard_edges(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose two faces carry different normals at both ends.

    At both: the sides of a cone share the normals along its base and part at its tip alone, and
    they are smooth. A face without normals says nothing, and makes no crease.
    """
    place = cleaned.face_map[_proper(control)]
    labels = np.empty_like(cleaned.mesh.faces)
    labels[place[place >= 0]] = _corner_labels(control)[place >= 0]
    label = labels.reshape(-1)
    topology = build_topology(cleaned.mesh.faces, len(cleaned.mesh.vertices))
    there, back = topology.half_edges[topology.interior].T
    hard = np.ones(len(topology.interior), dtype=bool)
    for corners, facing in ((there, next_corner(back)), (next_corner(there), back)):
        first, second = label[corners], label[facing]
        hard &= (first != second) & (first != _NO_NORMAL) & (second != _NO_NORMAL)
    return topology.edges[topology.interior[hard]]


def _proper(control: ControlMesh) -> np.ndarray:
    """Mark those of all faces that do not name a welded vertex twice."""
    return np.concatenate(control.kept)


def _corner_labels(control: ControlMesh) -> Int[np.ndarray, "P 3"]:
    """Label each corner of each proper face: equal normals at one vertex share a number."""
    labels = np.full(len(control.weld.vertex_of), _NO_NORMAL)
    chosen = [n for n, p in enumerate(control.primitives) if "NORMAL" in p.attributes]
    if chosen:
        rows = np.concatenate([np.arange(part.start, part.stop) for part in _rows(control, chosen)])
        normals = np.concatenate([control.primitives[n].attributes["NORMAL"] for n in chosen])
        labels[rows] = joined_normals(control.weld.vertex_of[rows], normals)
    return np.concatenate(
        [
            labels[primitive.corners[keep] + part.start]
            for primitive, keep, part in zip(
                control.primitives, control.kept, control.rows, strict=True
            )
        ]
    )


def _rows(control: ControlMesh, chosen: list[int]) -> list[slice]:
    return [control.rows[number] for number in chosen]
