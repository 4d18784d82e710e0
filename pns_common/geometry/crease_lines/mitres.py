"""Mitres: edges within a plane side that would fold it, since both of their ends stay.

Where three or more sharp edges meet a vertex stays where it is. Loop's mask still moves the vertex
of an edge between two such ones, along the plane that its faces lie in: in a picture frame that of
a mitre goes towards the frame's middle, over the inner rim, and its faces lie on others. Such an
edge is kept straight as the lines are, which no one sees in a plane: its vertex stays at its
middle, and those of the next level too.

An edge is one where a child of its two faces would turn over if its vertex went twice as far from
the middle as Loop's mask takes it, since a second level goes half as far again. In a parallelogram
the mask's vertex is the middle: a box has no mitres.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import cross, dot
from pns_common.connectivity.topology import EdgeClass, vertices_across
from pns_common.geometry.crease_lines.going_on import CORNER
from pns_common.geometry.crease_lines.turns import Edges, cosine_of

# Two faces that turn by less, in degrees, are in one plane.
PLANE = 1.0
# Loop's 3/8 (a + b) + 1/8 (c + d) is 1/8 of c + d − a − b from an edge's middle.
TWICE_AS_FAR = 2 / 8
# Of a face's area: where a child has just none, rounding shall not decide.
NO_CHILD = 1e-9


def with_mitres(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    lines: Int[np.ndarray, " N"],
) -> Int[np.ndarray, " M"]:
    """Return the edges of lines and the mitres between them, in order."""
    is_sharp = mesh.edge_class != EdgeClass.INTERIOR
    is_sharp[lines] = True
    ends = np.take(mesh.edges, np.flatnonzero(is_sharp), axis=0)
    meet = np.bincount(ends.reshape(-1), minlength=mesh.vertex_count)
    stays = meet >= CORNER
    if not stays.any():
        return lines
    rows = np.flatnonzero(stays[mesh.edges[:, 0]] & stays[mesh.edges[:, 1]] & ~is_sharp)
    first, second = mesh.half_edges[rows].T // 3
    rows = rows[dot(normals[first], normals[second]) > cosine_of(PLANE)]
    mitres = rows[would_fold(points, mesh, rows)]
    return np.sort(np.concatenate([lines, mitres.astype(lines.dtype)]))


def would_fold(
    points: Float[np.ndarray, "V 3"], mesh: Edges, rows: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return of which interior edges a face's child would turn over."""
    ends = mesh.edges[rows]
    across = vertices_across(mesh.faces, ends, mesh.half_edges[rows])
    a, b, c, d = (points[column] for column in (*ends.T, *across.T))
    middle = (a + b) / 2
    moved = middle + TWICE_AS_FAR * ((c + d) - (a + b))
    folds = np.zeros(len(rows), dtype=bool)
    for tip in (c, d):
        to_a, to_b, whole = (a + tip) / 2, (b + tip) / 2, cross(b - a, tip - a)
        least = NO_CHILD * dot(whole, whole)
        for corner, following in ((a, to_a), (to_b, b), (to_a, to_b)):
            child = cross(moved - corner, following - corner)
            folds |= dot(child, whole) <= least
    return folds
