"""Several meshes as one that joins nothing."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Int


def disjoint_faces(parts: Iterable[tuple[np.ndarray, int]]) -> Int[np.ndarray, "F 3"]:
    """Return the faces of all parts; a part's vertices follow those of the parts before it.

    Args:
        parts: of each its (F, 3) faces and the count of its vertices; at least one.
    """
    shifted: list[np.ndarray] = []
    start = 0
    for faces, vertex_count in parts:
        # Not in the parts' own type, in which the sum may not fit.
        shifted.append(faces.astype(np.int64) + start)
        start += vertex_count
    return np.concatenate(shifted)
