"""Crease lines: edges that the mesh itself shows to be sharp, found by four marks.

A coarse mesh does not say which of its turns are sharp and which are round: an edge of a cube turns
by 90 degrees, and one of an octahedron, which may stand for a sphere, by 71. What tells them apart
is what lies around:

1. *it is sharp*: its two faces' normals differ by more than θ;
2. *its sides are flat*: in each of the two faces another edge turns by less than half as much;
3. *it goes on*: at both ends it meets another such edge that runs on within θ of straight, or a
   corner of three or more, or a boundary, a crease that is named or another edge that is not
   interior, or a face without area; what does not is dropped, ``ROUNDS`` times over, so that a line
   that ends in a smooth surface loses as many edges there.

θ of 66 degrees lies between the turns of a hexagon and a pentagon: tubes of six sides stay round,
and a rim of six corners is a circle, but in edged meshes (below) six sides are edges.

A part that is made of plane faces has gentler edges too, chamfers and the plates of a hull. It is
known by its edges: a mesh is *edged* if at least half of those that turn by more than θ' = 21
degrees turn by more than θ. (Where sharp rims go round something most edges that turn are on the
round.) There, edges beyond θ' are lines too with the marks 2 and 3. But those beyond θ in a hollow
have to go on without gentler ones, as elsewhere (an armpit is round), and those up to 55 degrees
are lines only if

4. *it stands alone*: it is not in a row. Edges in a row have walls on both sides that are about as
   wide, and across each of these another edge like it, which runs within 20 degrees of parallel
   and turns the same way, with a quarter to three times its 1 − cos t; one that goes on from its
   end is not beside it. A row ends where walls of one width meet a sharper edge, whichever way
   that turns. A row is a tube or an arc: one of seven sides or more stays round, as a barrel does,
   where its walls are quads cut in two. So does a fillet of three pieces or more, whose arc begins
   and ends with half the turn of those between. But the chamfers of a bar are no row.

Both numbers are counts: a mesh in pieces has the same. Turning, moving, scaling or renumbering a
mesh does not change the answer, nor does mirroring it with its faces turned, but where rounding
decides. A mesh whose faces are turned over has ridges for hollows, and if it is edged it may have
other lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import cross, dot, marked, segment_sum, unit
from pns_common.connectivity.creases import Creases, with_crease_rows
from pns_common.connectivity.topology import EdgeClass, Topology

# θ in degrees, and at how many levels what is found is sharp: then it is smooth, and by then round
# within a quarter of an edge.
CREASE_ANGLE, CREASE_LEVELS = 66.0, 2
# θ' in degrees, of edged meshes, between the turns of tubes of 17 and 18 sides: where many edges
# turn by θ' itself, rounding decides. And of how many beyond it one turns by more than θ there.
EDGED_ANGLE, EDGED_ONE_IN = 21.0, 2
# Degrees beyond which an edge of an edged mesh need not stand alone: between the turns of a hexagon
# and a heptagon.
ROW_ANGLE = 55.0
# Others are like an edge within 20 degrees of parallel, and where their 1 − cos t is at most so
# many times its own, and its own so many times theirs: of 45 degrees 30 and 60 are like, and 90 is
# not. Half as many degrees are always like: their 1 − cos t is more than a quarter.
PARALLEL, TIMES_ITS_OWN, TIMES_THEIRS = math.cos(math.radians(20)), 3.0, 4.0
# How many times as wide as the other the wider of an edge's walls may be: in a row four times, as
# where a simplifier made one wall of some, and where it ends they are those of one arc, no plates.
UNEVEN, UNEVEN_END = 4.05, 1.1
ROUNDS = 5
# Edges whose surroundings are looked at together.
AT_ONCE = 8192
# So many lines that meet are a corner.
CORNER = 3


@runtime_checkable
class Edges(Protocol):
    """What is asked of a mesh's connectivity, whoever built it (``topology.Topology``)."""

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        ...

    @property
    def faces(self) -> Int[np.ndarray, "F 3"]:
        """Vertices of each face."""
        ...

    @property
    def edges(self) -> Int[np.ndarray, "E 2"]:
        """Endpoints."""
        ...

    @property
    def face_edges(self) -> Int[np.ndarray, "F 3"]:
        """Edges of each face."""
        ...

    @property
    def half_edges(self) -> Int[np.ndarray, "E 2"]:
        """The two half-edges 3 f + i of an interior edge."""
        ...

    @property
    def edge_class(self) -> Int[np.ndarray, " E"]:
        """EdgeClass values."""
        ...


def with_crease_lines(
    topology: Topology,
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    creases: Creases,
) -> Topology:
    """Return the topology with its crease lines as creases; unchanged where none are looked for."""
    if creases.line_angle is None:
        return topology
    return with_crease_rows(topology, line_rows(points, normals, topology, creases))


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
    gentle = False
    if creases.edged_angle is not None:
        bent = edges_beyond(normals, mesh, mesh.interior, cosine_of(creases.edged_angle))
        known = creases.edged
        gentle = is_edged(len(sharp), len(bent)) if known is None else known
        sharp = bent if gentle else sharp
    if len(sharp) == 0:
        return sharp
    flat = sharp[have_flat_sides(normals, mesh, sharp)]

    at_rim = may_end(mesh, normals)

    def going_on(rows: Int[np.ndarray, " N"]) -> Int[np.ndarray, " M"]:
        return rows[go_on(points, mesh, rows, at_rim, cosine)]

    if not gentle:
        return going_on(flat)
    alone = flat[stand_alone(points, normals, mesh, flat)]
    return with_gentler(points, normals, mesh, alone, cosine, going_on)


def with_gentler(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    alone: Int[np.ndarray, " N"],
    cosine: float,
    going_on: Callable[[Int[np.ndarray, " N"]], Int[np.ndarray, " M"]],
) -> Int[np.ndarray, " M"]:
    """Return the lines of an edged mesh: of edges with marks 1, 2 and 4 those that go on.

    ``going_on`` returns them of some edges.
    """
    is_sharp = _cosines(normals, mesh, alone) < cosine
    in_hollow = is_sharp & _rises(points, normals, mesh, alone)
    by_themselves = going_on(alone[is_sharp])
    return going_on(alone[~in_hollow | np.isin(alone, by_themselves)])


def cosine_of(degrees: float) -> float:
    """Return the cosine of an angle."""
    return math.cos(math.radians(degrees))


def is_edged(sharp: int, bent: int) -> bool:
    """Return whether a mesh with so many edges beyond θ, and beyond θ', is edged."""
    return sharp > 0 and EDGED_ONE_IN * sharp >= bent


def edges_beyond(
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    rows: Int[np.ndarray, " N"],
    cosine: float,
) -> Int[np.ndarray, " M"]:
    """Return those of some interior edges whose faces' normals have a smaller cosine.

    Faces without area have no normal, and no edge of theirs is sharp.
    """
    n1, n2 = _normals_at(normals, mesh, rows)
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    return rows[defined & (dot(n1, n2) < cosine)]


def have_flat_sides(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, sharp: Int[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return at which sharp edges both faces have another edge that turns less than half as much.

    An edge that is not interior turns by nothing, nor does one of a face without area.
    """
    sides = mesh.face_edges[mesh.half_edges[sharp] // 3]
    cosines = _cosines(normals, mesh, sides)
    own = sides == sharp[:, None, None]
    turn = cosines[:, 0][own[:, 0]]
    cosines[own] = -1.0
    flattest = cosines.max(axis=-1).min(axis=-1)
    return flattest > _half(turn)


def stand_alone(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " N"]:
    """Return which edges, beside flat sides, turn far or are in no row."""
    alone = np.empty(len(flat), dtype=bool)
    # A dozen others are looked at for each: not for all at once.
    for start in range(0, len(flat), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        alone[rows] = _stand_alone(points, normals, mesh, flat[rows])
    return alone


def _stand_alone(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
) -> Bool[np.ndarray, " N"]:
    turn = _cosines(normals, mesh, flat)
    has_like, has_sharper = (np.empty((2, len(flat)), dtype=bool) for _ in range(2))
    for side, face in enumerate((mesh.half_edges[flat] // 3).T):
        sides = mesh.face_edges[face]
        is_flat = (sides != flat[:, None]) & (_cosines(normals, mesh, sides) > _half(turn)[:, None])
        beyond = _across(mesh, sides, face[:, None])
        # What lies across a side that is not flat, or is none, is the edge itself: no other.
        others = np.where(is_flat[:, :, None], mesh.face_edges[beyond], flat[:, None, None])
        seen = np.concatenate([sides, others.reshape(len(flat), -1)], axis=1)
        like, sharper = _beside(points, normals, mesh, flat, turn, seen)
        has_like[side], has_sharper[side] = like.any(axis=1), sharper.any(axis=1)
    ends = (has_like & has_sharper[::-1]).any(axis=0) & _as_wide(points, mesh, flat, UNEVEN_END)
    in_row = (has_like.all(axis=0) & _as_wide(points, mesh, flat, UNEVEN)) | ends
    return (turn < cosine_of(ROW_ANGLE)) | ~in_row


def _as_wide(
    points: Float[np.ndarray, "V 3"], mesh: Edges, flat: Int[np.ndarray, " N"], times: float
) -> Bool[np.ndarray, " N"]:
    """Return at which edges neither face is more than so many times as wide as the other."""
    # Over a common edge that is how their areas are.
    corners = points[mesh.faces[mesh.half_edges[flat].T.reshape(-1) // 3]]
    area = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    first, second = dot(area, area).reshape(2, -1)
    most = times * times
    return (first <= most * second) & (second <= most * first)


def _beside(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
    turn: Float[np.ndarray, " N"],
    seen: Int[np.ndarray, "N K"],
) -> tuple[Bool[np.ndarray, "N K"], Bool[np.ndarray, "N K"]]:
    """Return which other edges run beside each one and turn as it does, and which more sharply.

    ``turn`` is its cosine.
    """
    cosines = _cosines(normals, mesh, seen)
    own, other = _along(points, mesh, flat), _along(points, mesh, seen)
    along = dot(other, own[:, None])
    parallel = along * along >= PARALLEL**2 * (dot(other, other) * dot(own, own)[:, None])
    bend, bends = (1 - turn)[:, None], 1 - cosines
    as_far = (bends <= TIMES_ITS_OWN * bend) & (bend <= TIMES_THEIRS * bends)
    same_way = _rises(points, normals, mesh, seen) == _rises(points, normals, mesh, flat)[:, None]
    ends, own_ends = mesh.edges[seen], mesh.edges[flat][:, None]
    starts, stops = (ends == own_ends).any(axis=-1), (ends == own_ends[..., ::-1]).any(axis=-1)
    goes_on = (starts & (along < 0)) | (stops & (along > 0))
    beside = (seen != flat[:, None]) & parallel & ~goes_on
    return beside & as_far & same_way, beside & (bends > TIMES_ITS_OWN * bend)


def go_on(
    points: Float[np.ndarray, "V 3"],
    mesh: Edges,
    flat: Int[np.ndarray, " N"],
    at_rim: Bool[np.ndarray, " V"],
    cosine: float,
) -> Bool[np.ndarray, " N"]:
    """Return which edges are left when those are dropped that do not go on at both ends.

    ``at_rim`` says where a line may end.
    """
    ends = mesh.edges[flat]
    along = unit(points[ends[:, 1]] - points[ends[:, 0]])
    left = np.ones(len(flat), dtype=bool)
    for _ in range(ROUNDS):
        at = ends[left].T.reshape(-1)
        count = np.bincount(at, minlength=mesh.vertex_count)
        # Of two that meet, u and v away from there: ‖u + v‖² = 2 + 2 u · v, 0 where they are
        # straight. Two numbers have one sum in either order.
        away = np.concatenate([along[left], -along[left]])
        total = segment_sum(away, at, mesh.vertex_count)
        straight = (count == 2) & (dot(total, total) < 2 - 2 * cosine)
        on = at_rim | straight | (count >= CORNER)
        going_on = left & on[ends].all(axis=1)
        if (going_on == left).all():
            break
        left = going_on
    return left


def may_end(mesh: Edges, normals: Float[np.ndarray, "F 3"]) -> Bool[np.ndarray, " V"]:
    """Return where a line may end: at edges that are not interior, and faces without a normal."""
    others = mesh.edges[mesh.edge_class != EdgeClass.INTERIOR]
    without = mesh.faces[dot(normals, normals) == 0]
    return marked(np.concatenate([others.reshape(-1), without.reshape(-1)]), mesh.vertex_count)


def _normals_at(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> tuple[Float[np.ndarray, "... 3"], Float[np.ndarray, "... 3"]]:
    """Return the unit normals of the two faces of interior edges."""
    faces = mesh.half_edges[rows] // 3
    return normals[faces[..., 0]], normals[faces[..., 1]]


def _cosines(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> Float[np.ndarray, "..."]:
    """Return the cosines of edges' turns: 1 where one is not interior, or a face has no normal."""
    cosines = np.ones(rows.shape)
    interior = mesh.edge_class[rows] == EdgeClass.INTERIOR
    n1, n2 = _normals_at(normals, mesh, rows[interior])
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    cosines[interior] = np.where(defined, dot(n1, n2), 1.0)
    return cosines


def _half(cosine: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return cos(t / 2) of cos t."""
    return np.sqrt((1 + np.maximum(cosine, -1.0)) / 2)


def _across(
    mesh: Edges, edges: Int[np.ndarray, "N K"], faces: Int[np.ndarray, "N 1"]
) -> Int[np.ndarray, "N K"]:
    """Return the other face of each interior edge; the face itself where there is none."""
    both = mesh.half_edges[edges] // 3
    other = np.where(both[..., 0] == faces, both[..., 1], both[..., 0])
    return np.where(mesh.edge_class[edges] == EdgeClass.INTERIOR, other, faces)


def _along(
    points: Float[np.ndarray, "V 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> Float[np.ndarray, "... 3"]:
    """Return the vectors along edges."""
    ends = mesh.edges[rows]
    return points[ends[..., 1]] - points[ends[..., 0]]


def _rises(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Edges,
    rows: Int[np.ndarray, "..."],
) -> Bool[np.ndarray, "..."]:
    """Return whether an edge's second face rises above its first: the edge is in a hollow."""
    ends, faces = mesh.edges[rows], mesh.half_edges[rows] // 3
    corners = mesh.faces[faces[..., 1]]
    is_end = (corners == ends[..., :1]) | (corners == ends[..., 1:])
    # The corner of a triangle that is on neither end.
    place = np.where(~is_end[..., 0], 0, np.where(~is_end[..., 1], 1, 2))
    apart = np.take_along_axis(corners, place[..., None], axis=-1)[..., 0]
    return dot(normals[faces[..., 0]], points[apart] - points[ends[..., 0]]) > 0
