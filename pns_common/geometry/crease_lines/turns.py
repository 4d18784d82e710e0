"""How far edges turn, and which way: what is sharp (mark 1)."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import dot
from pns_common.connectivity.topology import EdgeClass

# Cosines this near to each other are alike: one edge may turn by just half of another, as 45 of 90
# degrees, and rounding would decide. Beside 180 degrees it takes a root of what is rounded.
CLEARLY = 1e-6
# Two faces that turn by less, in degrees, lie in one plane: far above what single precision does to
# one, far below what shading shows of an edge. It is no angle that circles are cut into: where many
# edges turn by it rounding would decide.
IN_ONE_PLANE = 0.101


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


def cosine_of(degrees: float) -> float:
    """Return the cosine of an angle."""
    return math.cos(math.radians(degrees))


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


def turn_cosines(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> Float[np.ndarray, "..."]:
    """Return the cosines of edges' turns: 1 where one is not interior, or a face has no normal."""
    cosines = np.ones(rows.shape)
    interior = mesh.edge_class[rows] == EdgeClass.INTERIOR
    n1, n2 = _normals_at(normals, mesh, rows[interior])
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    cosines[interior] = np.where(defined, dot(n1, n2), 1.0)
    return cosines


def clearly_half(cosine: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return cos(t / 2) of cos t, and a little more: what is above turns clearly less than half."""
    return np.sqrt((1 + np.maximum(cosine, -1.0)) / 2) + CLEARLY


def rises(
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


def _normals_at(
    normals: Float[np.ndarray, "F 3"], mesh: Edges, rows: Int[np.ndarray, "..."]
) -> tuple[Float[np.ndarray, "... 3"], Float[np.ndarray, "... 3"]]:
    """Return the unit normals of the two faces of interior edges."""
    faces = mesh.half_edges[rows] // 3
    return normals[faces[..., 0]], normals[faces[..., 1]]
