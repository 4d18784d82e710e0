"""What a glTF mesh's shading shows of its edges: which are sharp, and which are meant round."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.crease_lines import NO_PAIRS
from pns_common.geometry.shaded_smooth import shaded_smooth
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .hard_edges import corner_labels, shading_of, without_one_normal


def shaded_edges(
    control: ControlMesh, cleaned: Cleaned, part_of_face: Int[np.ndarray, " F"], count: int
) -> tuple[Int[np.ndarray, "N 2"], Int[np.ndarray, "M 2"]]:
    """Return the hard edges of the meshes that are shaded smooth, and smooth ones beside hard ones.

    Pairs of vertices of a union of `count` meshes. Who said of some edges of a mesh that they are
    hard meant others to be round.
    """
    if not any("NORMAL" in primitive.attributes for primitive in control.primitives):
        return NO_PAIRS, NO_PAIRS
    mesh, labels = cleaned.mesh, corner_labels(control, cleaned)
    parted = without_one_normal(cleaned, labels)
    if not parted.any():
        return NO_PAIRS, NO_PAIRS
    shading = shading_of(cleaned, labels, parted)
    part = part_of_face[shading.faces[:, 0]]
    is_smooth = shaded_smooth(mesh.vertices, mesh.faces, shading.faces, shading.smooth, part, count)
    has_hard = np.bincount(part[shading.hard], minlength=count) > 0
    hard, smooth = shading.hard & is_smooth[part], shading.smooth & has_hard[part]
    return shading.edges[hard], shading.edges[smooth]
