"""Which edges an artist's shading shows to be sharp: hard ones, in a mesh that is shaded smooth.

Who shades a mesh smooth and leaves some edges hard has said which are sharp, at whatever angle.
They are kept beside the lines that the shape shows. A mesh that is shaded flat says nothing, and
nor do smooth edges: many a tool gives each vertex the mean of its faces' normals.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import dot
from pns_common.connectivity.creases import Creases
from pns_common.crease_lines import crease_lines
from pns_common.geometry.frames import face_normals
from pns_common.mesh import Cleaned, Mesh

from .control_mesh import ControlMesh
from .hard_edges import Shading, corner_labels, shading_of, without_one_normal
from .parts import Parts

# Edges that turn by less say nothing: a flat face of many corners has some.
BENT = np.radians(1.0)
# Where more than this share of a mesh's bent edges is smooth, its hard ones were meant. Of quads
# that are shaded flat the diagonals are smooth, a third of all edges.
SMOOTH = 1 / 2


def creases_by_shading(
    control: ControlMesh, cleaned: Cleaned, lines: Creases, parts: Parts | None
) -> Creases:
    """Return the lines with the hard edges of the meshes that are shaded smooth, by name.

    The lines alone, as they are, where there are none. `parts` are the meshes of a union; None: it
    is one mesh.
    """
    if lines.line_angle is None or not _have_normals(control):
        return lines
    mesh, labels = cleaned.mesh, corner_labels(control, cleaned)
    if not without_one_normal(cleaned, labels).any():
        return lines
    shading, part = shading_of(cleaned, labels), _part_of_face(control, cleaned, parts)
    part_of_edge = part[shading.faces[:, 0]]
    is_smooth = _shaded_smooth(mesh, shading, part_of_edge, 1 if parts is None else parts.count)
    hard = shading.edges[shading.hard & is_smooth[part_of_edge]]
    if len(hard) == 0:
        return lines
    shown = crease_lines(mesh, lines.line_angle)
    return Creases(np.concatenate([hard, shown]), levels=lines.levels)


def _have_normals(control: ControlMesh) -> bool:
    return any("NORMAL" in primitive.attributes for primitive in control.primitives)


def _part_of_face(
    control: ControlMesh, cleaned: Cleaned, parts: Parts | None
) -> Int[np.ndarray, " F"]:
    """Return the part of each face of the mesh to refine."""
    of_face = np.zeros(len(cleaned.mesh.faces), dtype=np.int64)
    if parts is not None:
        kept = np.concatenate(control.kept)
        place = cleaned.face_map[kept]
        of_face[place[place >= 0]] = parts.of_face[kept][place >= 0]
    return of_face


def _shaded_smooth(
    mesh: Mesh, shading: Shading, part: Int[np.ndarray, " I"], count: int
) -> Bool[np.ndarray, " P"]:
    """Return of which parts more than half of the bent edges are smooth; `part` is the edges'."""
    normals = face_normals(mesh.vertices, mesh.faces)
    first, second = shading.faces.T
    # A face without area has no normal: its edges turn by nothing.
    has_area = normals.any(axis=1)
    bent = dot(normals[first], normals[second]) < np.cos(BENT)
    bent &= has_area[first] & has_area[second]
    smooth = np.bincount(part[bent & shading.smooth], minlength=count)
    return smooth > SMOOTH * np.bincount(part[bent], minlength=count)
