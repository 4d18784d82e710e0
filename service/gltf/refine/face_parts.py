"""Of which part of a union each face of the mesh to refine is."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh
from .parts import Parts


def part_of_face(
    control: ControlMesh, cleaned: Cleaned, parts: Parts | None
) -> tuple[Int[np.ndarray, " F"], int]:
    """Return the part of each face of the mesh to refine, and how many there are."""
    if parts is None:
        return np.zeros(len(cleaned.mesh.faces), dtype=np.int64), 1
    of_face = control.of_cleaned(cleaned, parts.of_face[np.concatenate(control.kept)])
    return of_face, parts.count
