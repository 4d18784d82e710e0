"""Normals that say what the faces around do not: their author's own.

Foliage is lit as the ball that it fills, a bevel is shaded as the plane beside it, a drawn face as
a flat one. At a border, normals may be made with faces of another mesh, as where a head is put on a
body, or of the mesh's own mirror image. Recomputed from faces such shading would be lost, and seams
be seen, so these normals go on as the file's are interpolated.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import cross, dot, norm, unit
from pns_common.fused.where_loaded.interior_edges import interior_edges
from pns_common.mesh import Mesh

# Exporters average the normals of faces by angle, by area or alike. On real meshes 9 of 10 of these
# averages lie within 10° of each other and 99 of 100 within 17°: who averaged says nothing own.
# Where each of these averages is asked for, at borders, a degree is told from none.
INSIDE, AT_BORDER = np.cos(np.radians([[10.0, 20.0], [1.0, 2.0]]))


def own_shares(
    given: Float[np.ndarray, "C 3"],
    computed: Float[np.ndarray, "C 3"],
    limits: Float[np.ndarray, " 2"] = INSIDE,
) -> Float[np.ndarray, " C"]:
    """Return how much of each given normal is its author's own: 0 up to 10°, 1 from 20° on.

    `computed` are the unit normals of the faces around, 0 where these have no area. `limits` are
    the cosines of both angles.
    """
    known = (norm(given) > 0) & computed.any(axis=1)
    none, whole = limits
    cosine = dot(unit(given), computed)
    shares: Float[np.ndarray, " C"] = np.clip((none - cosine) / (none - whole), 0.0, 1.0)
    return np.where(known, shares, 0.0)


def own_shares_at_border(
    given: Float[np.ndarray, "C 3"],
    computed: Float[np.ndarray, "C 3"],
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    corners: Int[np.ndarray, "F 3"],
    at_border: Bool[np.ndarray, " C"],
) -> Float[np.ndarray, " B"]:
    """Return the same for normals at borders: 0 up to 1° beside some average, 1 from 2° on.

    `corners` are those of `faces`, as numbers of the normals.
    """
    near = at_border[corners].any(axis=1)
    a, b, c = np.moveaxis(points[faces[near]], 1, 0)
    by_area = cross(b - a, c - a)
    averages = [computed]
    for weighted in (by_area, unit(by_area)):
        sums = np.zeros_like(given)
        np.add.at(sums, corners[near], weighted[:, None])
        averages.append(unit(sums))
    shares = [own_shares(given[at_border], each[at_border], AT_BORDER) for each in averages]
    return np.min(shares, axis=0)


def border_vertices(mesh: Mesh) -> Bool[np.ndarray, " V"]:
    """Return the vertices of edges that are not interior."""
    count = len(mesh.vertices)
    edges, _ = interior_edges(mesh.faces, count)
    # Where all edges are interior there are as many as faces.
    ends, faces = (np.bincount(each.reshape(-1), minlength=count) for each in (edges, mesh.faces))
    at_border: Bool[np.ndarray, " V"] = ends != faces
    return at_border
