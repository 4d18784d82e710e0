"""Crease lines: edges that the mesh itself shows to be sharp, found by three marks.

A coarse mesh does not say which of its turns are sharp and which are round: an edge of a cube turns
by 90 degrees, and one of an octahedron, which may stand for a sphere, by 71. What tells them apart
is what lies around:

1. *it is sharp*: its two faces' normals differ by more than θ;
2. *its sides are flat*: in each of the two faces another edge turns by less than half as much;
3. *it goes on*: at both ends it meets another such edge that runs on within θ of straight, or a
   corner of three or more, or the mesh's boundary; what does not is dropped, ``ROUNDS`` times over,
   so that a line that ends in a smooth surface loses as many edges there.

θ of 66 degrees lies between the turns of a hexagon and a pentagon: tubes of six sides stay round,
and a rim of six corners is a circle. Turning, moving, scaling, mirroring or renumbering a mesh does
not change the answer.
"""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import dot, gather, marked, segment_sum, unit
from pns_common.connectivity.creases import with_crease_rows
from pns_common.connectivity.topology import EdgeClass, Topology

# θ in degrees, and at how many levels what is found is sharp: then it is smooth, and by then round
# within a quarter of an edge.
CREASE_ANGLE, CREASE_LEVELS = 66.0, 2
ROUNDS = 5
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
    angle: float | None,
) -> Topology:
    """Return the topology with its crease lines as creases; unchanged where no angle is given."""
    if angle is None:
        return topology
    return with_crease_rows(topology, line_rows(points, normals, topology, angle))


def line_rows(
    points: Float[np.ndarray, "V 3"],
    normals: Float[np.ndarray, "F 3"],
    mesh: Topology,
    angle: float,
) -> Int[np.ndarray, " N"]:
    """Return the edges of a mesh's crease lines.

    ``normals`` are the faces' unit normals, 0 without area; ``angle`` is θ in degrees.
    """
    cosine = math.cos(math.radians(angle))
    sharp = edges_beyond(normals, mesh, mesh.interior, cosine)
    if len(sharp) == 0:
        return sharp
    flat = sharp[have_flat_sides(normals, mesh, sharp)]
    return flat[go_on(points, mesh, flat, cosine)]


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

    An edge that is not interior turns by nothing.
    """
    sides = mesh.face_edges[mesh.half_edges[sharp] // 3]
    interior = mesh.edge_class[sides] == EdgeClass.INTERIOR
    cosines = np.ones(sides.shape)
    cosines[interior] = dot(*_normals_at(normals, mesh, sides[interior]))
    own = sides == sharp[:, None, None]
    turn = cosines[:, 0][own[:, 0]]
    cosines[own] = -1.0
    flattest = cosines.max(axis=-1).min(axis=-1)
    half = np.sqrt((1 + np.maximum(turn, -1.0)) / 2)  # cos(t / 2) of cos t
    return flattest > half


def go_on(
    points: Float[np.ndarray, "V 3"], mesh: Edges, flat: Int[np.ndarray, " N"], cosine: float
) -> Bool[np.ndarray, " N"]:
    """Return which edges are left when those are dropped that do not go on at both ends."""
    ends = mesh.edges[flat]
    along = unit(points[ends[:, 1]] - points[ends[:, 0]])
    at_rim = at_others(mesh)
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


def at_others(mesh: Edges) -> Bool[np.ndarray, " V"]:
    """Return which vertices are on an edge that is not interior: there a line may end."""
    others = mesh.edges[mesh.edge_class != EdgeClass.INTERIOR]
    return marked(others.reshape(-1), mesh.vertex_count)


def _normals_at(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, " N"]
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Return the unit normals of the two faces of interior edges."""
    faces = mesh.half_edges[rows] // 3
    return gather(normals, faces[:, 0]), gather(normals, faces[:, 1])
