"""What becomes of double positions in a format that stores float32."""

from __future__ import annotations

import numpy as np

from pns_common.mesh import repeated_vertex
from pns_common.rows import distinct_rows

from ..errors import UnrefinableError
from ..meshes.far_from_origin import STEPS, faces_too_far
from ..meshes.weld import canonical_zero
from ..report import Change
from .indexed_triangles import IndexedTriangles

LARGEST = float(np.finfo(np.float32).max)


def rounding_changes(triangles: IndexedTriangles) -> list[Change]:
    """Count the faces to which float32 leaves no area, and those to which it leaves few steps.

    Raises:
        UnrefinableError: a position beyond the range of float32.
    """
    if np.abs(triangles.vertices).max() > LARGEST:
        raise UnrefinableError("positions leave the range of float32; write an OBJ or OFF file")
    rounded = canonical_zero(triangles.vertices.astype(np.float32))
    before, after = (
        repeated_vertex(distinct_rows(rows)[triangles.faces])
        for rows in (canonical_zero(triangles.vertices), rounded)
    )
    rounding = "once positions are rounded to float32"
    told = {
        f"faces without an area {rounding}": int((after & ~before).sum()),
        f"faces too far from the origin {rounding}: fewer than {STEPS} steps to a side": (
            faces_too_far(triangles.vertices, triangles.faces)
        ),
    }
    return [Change("", what, count) for what, count in told.items() if count]
