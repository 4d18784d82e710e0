"""Edges within plane sides that are held, since Loop would fold the sides beside their lines.

A corner of lines stays where it is, and so does a line that runs straight. Loop's mask still moves
the vertex of an edge that begins there, along the plane that its faces lie in: in a picture frame
that of a mitre goes towards the frame's middle, over the inner rim, and in a side that is cut into
uneven triangles it goes over a narrow one. Such an edge is kept straight as the lines are, which no
one sees in a plane: its vertex stays at its middle, and those of the next level too.

Both of its ends are such vertices; or one is, and all around the other lies in the plane, and three
such edges end there, so that it stays too. None ends where a line bends: one crease more would make
a corner of a round rim. Where the mask's vertices are the edges' middles anyway nothing is held, as
in a box, whose sides are parallelograms, and in a regular fan.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import dot, gather, marked, unit
from pns_common.connectivity.topology import EdgeClass, vertices_across
from pns_common.geometry.crease_lines.going_on import CORNER, runs_straight
from pns_common.geometry.crease_lines.plane_sides import end_at, in_planes
from pns_common.geometry.crease_lines.turns import IN_ONE_PLANE, Edges, cosine_of, turn_cosines

# A line that turns by less at a vertex, in degrees, runs straight there: no angle that circles are
# cut into, as IN_ONE_PLANE is none.
STRAIGHT = 0.505
# Loop's 3/8 (a + b) + 1/8 (c + d) is 1/8 of c + d − a − b from an edge's middle; so far, as a share
# of the edge, may it go.
NEAR = 0.01


def with_held_edges(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    lines: Int[np.ndarray, " N"],
) -> Int[np.ndarray, " M"]:
    """Return the edges of lines and those that are held beside them, in order."""
    is_line = mesh.edge_class == EdgeClass.CREASE
    is_line[lines] = True
    if not is_line.any():
        return lines
    is_sharp = is_line | (mesh.edge_class != EdgeClass.INTERIOR)
    stays = staying(points, mesh, np.flatnonzero(is_line), np.flatnonzero(is_sharp))
    rows = np.flatnonzero(end_at(stays, mesh) & ~is_sharp)
    rows = rows[turn_cosines(normals, mesh, rows) > cosine_of(IN_ONE_PLANE)]
    moved = slides(points, mesh, rows)
    if not moved.any():
        return lines
    both = stays[mesh.edges[rows]].all(axis=1)
    between, from_line = rows[both & moved], rows[~both]
    ends = mesh.edges[from_line]
    others = np.where(stays[ends[:, 0]], ends[:, 1], ends[:, 0])
    held = np.bincount(others, minlength=mesh.vertex_count) >= CORNER
    held &= marked(others[moved[~both]], mesh.vertex_count)
    held = in_planes(normals, mesh, is_sharp, np.flatnonzero(held))
    rows = np.concatenate([between, from_line[held[others]]])
    return np.sort(np.concatenate([lines, rows.astype(lines.dtype)]))


def staying(
    points: Float[np.ndarray, "V 3"],
    mesh: Edges,
    lines: Int[np.ndarray, " N"],
    sharp: Int[np.ndarray, " S"],
) -> Bool[np.ndarray, " V"]:
    """Return at which vertices lines make a corner, or run straight on.

    ``sharp`` are all edges that are not smooth, boundaries too.
    """
    ends = gather(mesh.edges, lines)
    on_lines, meet = (
        np.bincount(gather(mesh.edges, rows).reshape(-1), minlength=mesh.vertex_count)
        for rows in (lines, sharp)
    )
    stays = (on_lines > 0) & (meet >= CORNER)
    # Lines are few: sums are of the vertices on them alone.
    at = np.flatnonzero(on_lines)
    number = np.empty(mesh.vertex_count, dtype=np.int64)
    number[at] = np.arange(len(at))
    along = unit(gather(points, ends[:, 1]) - gather(points, ends[:, 0]))
    places = gather(number, ends.T.reshape(-1))
    straight = runs_straight(along, places, on_lines[at], cosine_of(STRAIGHT))
    stays[at] |= straight & (meet[at] == 2)
    return stays


def slides(
    points: Float[np.ndarray, "V 3"], mesh: Edges, rows: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return of which interior edges Loop's mask moves the vertex away from the middle."""
    ends = mesh.edges[rows]
    across = vertices_across(mesh.faces, ends, mesh.half_edges[rows])
    a, b, c, d = (points[column] for column in (*ends.T, *across.T))
    off, along = ((c + d) - (a + b)) / 8, b - a
    return dot(off, off) > NEAR**2 * dot(along, along)
