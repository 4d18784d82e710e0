"""Borders of what the primitives of a glTF mesh draw on its flat sides, in colours of their own."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from pns_common.flat_borders import flat_borders
from pns_common.mesh import Cleaned

from .control_mesh import ControlMesh


def drawn_borders(control: ControlMesh, cleaned: Cleaned) -> Int[np.ndarray, "N 2"]:
    """Return these borders, as pairs of vertices of the mesh to refine."""
    counts = [int(keep.sum()) for keep in control.kept]
    primitive = control.of_cleaned(cleaned, np.repeat(np.arange(len(counts)), counts))
    return flat_borders(cleaned.mesh.vertices, cleaned.mesh.faces, primitive)
