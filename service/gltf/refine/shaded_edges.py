"""Which edges of a glTF mesh its shading shows to be sharp: hard ones of what is shaded smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pns_common.connectivity.creases import Creases
from pns_common.crease_lines import named_on_parts, without_gentle
from pns_common.geometry.shaded_smooth import shaded_smooth
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .face_parts import part_of_face
from .hard_edges import corner_labels, shading_of, without_one_normal
from .parts import Parts


def creases_by_shading(
    control: ControlMesh, cleaned: Cleaned, lines: Creases, parts: Parts | None
) -> Creases:
    """Return the lines with the hard edges of the meshes that are shaded smooth, by name.

    The lines alone, as they are, where there are none. `parts` are the meshes of a union; None: it
    is one mesh.
    """
    if not _have_normals(control):
        return lines
    mesh, labels = cleaned.mesh, corner_labels(control, cleaned)
    parted = without_one_normal(cleaned, labels)
    if not parted.any():
        return lines
    shading = shading_of(cleaned, labels, parted)
    part, count = part_of_face(control, cleaned, parts)
    part_of_edge = part[shading.faces[:, 0]]
    is_smooth = shaded_smooth(
        mesh.vertices, mesh.faces, shading.faces, shading.smooth, part_of_edge, count
    )
    hard = shading.hard & is_smooth[part_of_edge]
    # Who said of some edges that they are hard meant others to be round.
    told = np.bincount(part_of_edge[shading.hard], minlength=count) > 0
    smooth = shading.smooth & told[part_of_edge]
    if not (hard | smooth).any():
        return lines
    shown = named_on_parts(mesh, lines, part, count)
    shown = without_gentle(shown, mesh, lines, shading.edges[smooth])
    named = [shading.edges[hard]] if shown.named is None else [shading.edges[hard], shown.named]
    return replace(shown, named=np.concatenate(named))


def _have_normals(control: ControlMesh) -> bool:
    return any("NORMAL" in primitive.attributes for primitive in control.primitives)
