"""Crease lines: edges that the mesh itself shows to be sharp, found by four marks.

A coarse mesh does not say which of its turns are sharp and which are round: an edge of a cube turns
by 90 degrees, and one of an octahedron, which may stand for a sphere, by 71. What tells them apart
is what lies around:

1. *it is sharp*: its two faces' normals differ by more than θ;
2. *it lies between two sides*: in each of its two faces another edge turns by less than half as
   much, or in one, and the other is a side by itself, as the end of a wedge or a gable is: all of
   its edges are sharp, and in each face across them another turns by less than half as much;
3. *it goes on*: at both ends it meets another such edge that runs on within θ of straight, or a
   corner of three or more, or a boundary, a crease that is named or another edge that is not
   interior, or a face without area; what does not is dropped, ``ROUNDS`` times over, so that a line
   that ends in a smooth surface loses as many edges there.

θ of 66 degrees lies between the turns of a hexagon and a pentagon: tubes of six sides stay round,
and a rim of six corners is a circle, but in edged meshes (below) six sides are edges.

A part that is made of plane faces has gentler edges too, chamfers and the plates of a hull. There,
edges beyond θ' = 21 degrees are lines too with the marks 2 and 3, but those up to 55 degrees only
if

4. *it stands alone*: it is not in a row. Edges in a row have walls on both sides, neither more than
   four times as wide as the other, and across each of these another edge like it, which runs within
   19.5 degrees of parallel and turns the same way, with a quarter to three times its 1 − cos t; one
   that goes on from its end is not beside it. A row ends where walls of one width, to a tenth, meet
   a sharper edge, whichever way that turns. A row is a tube or an arc: one of seven sides or more
   stays round, as a barrel does, where its walls are quads cut in two. So does a fillet of three
   pieces or more, whose arc begins and ends with half the turn of those between. But chamfers of a
   bar that are a fifth as wide as its sides are no row.

Such a part is known by its edges: a mesh is *edged* if at least half of those beyond θ' that stand
alone turn by more than θ. Those in rows are on something round, as a pipe, a hole or a fillet of
the part is, and say nothing of the others.

Sides that were cut finely tell of themselves that they are plane (plane_sides.py): beside one an
edge beyond θ' is a line with the marks 2, 3 and 4 in any mesh.

With them go edges that are held within plane sides, as a frame's mitres (held_edges.py).

What makes a mesh edged are counts, and those of its pieces add up. Turning, moving, scaling or
renumbering a mesh does not change the answer, nor does mirroring it or turning its faces over, but
where rounding decides.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.connectivity.creases import Creases, with_crease_rows
from pns_common.connectivity.topology import Topology
from pns_common.geometry.crease_lines.edge_rows import stand_alone
from pns_common.geometry.crease_lines.going_on import go_on, may_end
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.geometry.crease_lines.plane_sides import beside_planes
from pns_common.geometry.crease_lines.sides import between_sides
from pns_common.geometry.crease_lines.turns import cosine_of, edges_beyond

# θ in degrees, and at how many levels what is found is sharp: then it is smooth, and by then round
# within a quarter of an edge.
CREASE_ANGLE, CREASE_LEVELS = 66.0, 2
# θ' in degrees, of edged meshes, between the turns of tubes of 17 and 18 sides: where many edges
# turn by θ' itself, rounding decides. And of how many beyond it that stand alone one turns by more
# than θ there.
EDGED_ANGLE, EDGED_ONE_IN = 21.0, 2


def with_crease_lines(
    topology: Topology,
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    creases: Creases,
) -> Topology:
    """Return the topology with its crease lines, and what is held beside them, as creases.

    It is unchanged where none are looked for.
    """
    if creases.line_angle is None:
        return topology
    lines = line_rows(points, normals, topology, creases)
    return with_crease_rows(topology, with_held_edges(points, normals, topology, lines))


def line_rows(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Topology,
    creases: Creases,
) -> Int[np.ndarray, " N"]:
    """Return the edges of a mesh's crease lines, which ``creases`` say to look for.

    ``normals`` are the faces' unit normals, 0 without area.
    """
    assert creases.line_angle is not None
    cosine = cosine_of(creases.line_angle)
    sharp = edges_beyond(normals, mesh, mesh.interior, cosine)
    rows = sharp[between_sides(normals, mesh, sharp)]
    if creases.edged_angle is not None:
        bent = edges_beyond(normals, mesh, mesh.interior, cosine_of(creases.edged_angle))
        alone, known = stand_alone(points, normals, mesh, bent), creases.edged
        gentle = bent[alone & between_sides(normals, mesh, bent)]
        if is_edged(len(sharp), int(alone.sum())) if known is None else known:
            rows = gentle
        else:
            rows = np.union1d(rows, gentle[beside_planes(normals, mesh, gentle)])
    return rows[go_on(points, mesh, rows, may_end(mesh, normals), cosine)]


def is_edged(sharp: int, alone: int) -> bool:
    """Return whether a mesh is edged with so many edges beyond θ, and beyond θ' in no row."""
    return sharp > 0 and EDGED_ONE_IN * sharp >= alone
