"""What becomes of double positions in a format that stores float32."""

from __future__ import annotations

import numpy as np

from pns_common.mesh import repeated_vertex
from service.errors import UnrefinableError
from service.gltf.report import Change
from service.soup import TriangleSoup
from service.weld import canonical_zero, distinct_rows

LARGEST = float(np.finfo(np.float32).max)


def rounding_changes(soup: TriangleSoup) -> list[Change]:
    """The faces that lose their area because float32 cannot tell their corners apart.

    Raises:
        UnrefinableError: a position beyond the range of float32.
    """
    if np.abs(soup.vertices).max() > LARGEST:
        raise UnrefinableError("positions leave the range of float32; write an OBJ or OFF file")
    rounded = canonical_zero(soup.vertices.astype(np.float32))
    before, after = (
        repeated_vertex(distinct_rows(rows)[soup.faces])
        for rows in (canonical_zero(soup.vertices), rounded)
    )
    flat = int((after & ~before).sum())
    text = "faces without an area once positions are rounded to float32"
    return [Change("", text, flat)] if flat else []
