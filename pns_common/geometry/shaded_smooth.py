"""Whether a mesh is shaded smooth: then its hard edges were meant, at whatever angle.

Who shades a mesh smooth and leaves some edges hard has said which are sharp. A mesh that is shaded
flat says nothing, and nor do smooth edges: many a tool gives each vertex the mean of its faces'
normals.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.geometry.frames import face_normals
from pns_common.geometry.sharp_edges import turn_by_more

# Edges that turn by less (radians) say nothing: a flat face of many corners has some.
BENT = math.radians(1.0)
# A mesh is shaded smooth where more than this share of its bent edges is. Of quads that are shaded
# flat the diagonals are smooth, a third of all edges.
SMOOTH = 1 / 2


def shaded_smooth(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    edge_faces: Int[np.ndarray, "I 2"],
    smooth: Bool[np.ndarray, " I"],
    part: Int[np.ndarray, " I"] | None = None,
    part_count: int = 1,
) -> Bool[np.ndarray, " P"]:
    """Return which of P parts of a mesh are shaded smooth, by their interior edges.

    ``edge_faces`` are the two faces of each edge, ``smooth`` says which are shaded as one surface,
    ``part`` of which part they are; None: all are of one.
    """
    bent = turn_by_more(face_normals(points, faces), edge_faces, BENT)
    part = np.zeros(len(bent), dtype=np.int64) if part is None else part
    of_smooth = np.bincount(part[bent & smooth], minlength=part_count)
    return of_smooth > SMOOTH * np.bincount(part[bent], minlength=part_count)
