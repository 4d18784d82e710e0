"""Plane sides: what is round has no vertex inside of its facets.

A facet of something round is a triangle, a quad that was cut in two, or a row of them: all of its
vertices are where it turns. A side that was cut finely, as whoever meshes a part to compute with it
does, has vertices inside: all of their faces lie in one plane. So it is no facet, and where another
side meets it the part has an edge, however gentle.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import gather, marked
from pns_common.connectivity.topology import EdgeClass, vertices_across
from pns_common.geometry.crease_lines.turns import IN_ONE_PLANE, Edges, cosine_of, turn_cosines


def beside_planes(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return at which interior edges a face has its third corner inside a plane side."""
    if len(rows) == 0:
        return np.zeros(0, dtype=bool)
    across = vertices_across(mesh.faces, mesh.edges[rows], mesh.half_edges[rows])
    is_rim = mesh.edge_class != EdgeClass.INTERIOR
    inside = in_planes(normals, mesh, is_rim, across.reshape(-1))
    return inside[across[:, 0]] | inside[across[:, 1]]


def in_planes(
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    is_sharp: Bool[np.ndarray, " E"],
    asked: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " V"]:
    """Return which of the vertices that are asked for have one plane around them, and no line."""
    inside = marked(asked, mesh.vertex_count)
    rows = np.flatnonzero(end_at(inside, mesh))
    bent = is_sharp[rows]
    bent[~bent] = turn_cosines(normals, mesh, rows[~bent]) <= cosine_of(IN_ONE_PLANE)
    inside[mesh.edges[rows[bent]]] = False
    return inside


def end_at(marks: Bool[np.ndarray, " V"], mesh: Edges) -> Bool[np.ndarray, " E"]:
    """Return which edges have an end that is marked."""
    # One end of all after the other: for numpy that is half the work of rows of two.
    return np.logical_or(*(gather(marks, ends) for ends in mesh.edges.T))
