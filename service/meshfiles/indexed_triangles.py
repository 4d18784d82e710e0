"""Triangles as a mesh file has them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

# How text formats write a coordinate: micrometres are kept in coordinates of kilometres.
NUMBER = "%.12g"


@dataclass(frozen=True, eq=False)
class IndexedTriangles:
    """Triangles as a file has them: seams are open, vertices repeat.

    Attributes:
        vertices: (N, 3) positions.
        faces: (F, 3) rows of `vertices`.
        uv: (N, 2) texture coordinates, v upwards; None where there are none.
        split: triangles more than the file had faces, made by splitting its polygons.
        unused: vertices of the file that its reader has left out because no face uses them.
        unsupported: name and count of what the file held beside this.
    """

    vertices: Float[np.ndarray, "N 3"]
    faces: Int[np.ndarray, "F 3"]
    uv: Float[np.ndarray, "N 2"] | None = None
    split: int = 0
    unused: int = 0
    unsupported: dict[str, int] = field(default_factory=dict)
