"""How many joints a refined vertex may keep where primitives of a mesh have unequal room for them.

What two primitives share is as wide as the narrower: with more joints on one side than on the other
the common edge would open as soon as the mesh is posed.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .skins import SLOTS, skin_sets


def common_slots(
    control: ControlMesh, cleaned: Cleaned, refined_faces: Int[np.ndarray, "G 3"], count: int
) -> Int[np.ndarray, " V"] | None:
    """Return the slots of each of `count` refined vertices; None where all have the same room."""
    slots = [SLOTS * len(skin_sets(primitive)) for primitive in control.primitives]
    if min(slots) == max(slots):
        return None
    of_kept = np.repeat(slots, [int(keep.sum()) for keep in control.kept])
    of_face = np.full(len(cleaned.mesh.faces), max(slots))
    # Copies of a face share its refined vertices.
    np.minimum.at(of_face, cleaned.representative[np.concatenate(control.kept)], of_kept)
    at_vertices = np.full(count, max(slots))
    # Descendants lie as their faces do.
    children = np.repeat(of_face, len(refined_faces) // len(of_face))
    np.minimum.at(at_vertices, refined_faces, children[:, None])
    return at_vertices
