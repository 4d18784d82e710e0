"""What becomes of double positions in a format that stores float32."""

from __future__ import annotations

import numpy as np

from pns_common.base.distinct import distinct_rows
from pns_common.mesh import repeated_vertex

from ..errors import UnrefinableError
from ..meshes.weld import canonical_zero
from ..report import Change
from .indexed_triangles import IndexedTriangles

LARGEST = float(np.finfo(np.float32).max)


def rounding_changes(triangles: IndexedTriangles) -> list[Change]:
    """Count the faces that lose their area because float32 cannot tell their corners apart.

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
    flat = int((after & ~before).sum())
    text = "faces without an area once positions are rounded to float32"
    return [Change("", text, flat)] if flat else []
