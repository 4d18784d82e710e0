"""How far creases move a mesh's vertices from where Loop's smooth rules would put them.

The learned correction is measured from Loop with the same creases, which keeps a creased edge at
its middle and a corner where it is; so what a report says of the distance to Loop itself counts
this in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import norm
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import Topology, build_topology
from pns_common.masks.limit.positions import limit_positions
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices

Rule = Callable[[np.ndarray, Topology], np.ndarray]


@dataclass(frozen=True, eq=False)
class CreaseShift:
    """Vertices at creases, and how far these move them; creases, and how far their vertices move.

    Attributes:
        vertices, edges: their numbers.
        of_vertices, of_edges: lengths, in the mesh's units.
    """

    vertices: Int[np.ndarray, " N"]
    of_vertices: Float[np.ndarray, " N"]
    edges: Int[np.ndarray, " M"]
    of_edges: Float[np.ndarray, " M"]

    @property
    def largest(self) -> float:
        """The longest of all."""
        return float(max(self.of_vertices.max(initial=0), self.of_edges.max(initial=0)))


def crease_shift(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    rows: Int[np.ndarray, " N"],
    creases: Int[np.ndarray, "N 2"],
) -> CreaseShift | None:
    """Return how far creases move the vertices of the next level; None without creases.

    ``rows`` are their numbers among the level's edges, ``creases`` their ends.
    """
    if len(rows) == 0:
        return None
    near = _Near.of(points, faces, creases)
    middle = near.moved(loop_edge_vertices)[near.numbers_of(creases)]
    return CreaseShift(near.vertices, near.moved(loop_vertex_vertices), rows, middle)


def limit_crease_shift(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Int[np.ndarray, "N 2"],
) -> CreaseShift | None:
    """Return how far creases move a mesh's limits; None without creases."""
    if len(creases) == 0:
        return None
    near = _Near.of(points, faces, creases)
    nothing = np.zeros(0, dtype=np.int64)
    return CreaseShift(near.vertices, near.moved(limit_positions), nothing, np.zeros(0))


@dataclass(frozen=True, eq=False)
class _Near:
    """The faces around creases alone: there every vertex at a crease has its whole ring.

    Of the others nothing differs between the two topologies, so that they move by 0.
    """

    vertices: Int[np.ndarray, " N"]
    points: Float[np.ndarray, "N 3"]
    plain: Topology
    creased: Topology

    @classmethod
    def of(
        cls,
        points: Float[np.ndarray, "V 3"],
        faces: Int[np.ndarray, "F 3"],
        creases: Int[np.ndarray, "N 2"],
    ) -> _Near:
        at_creases = np.zeros(len(points), dtype=bool)
        at_creases[creases.reshape(-1)] = True
        near = np.asarray(faces[at_creases[faces].any(axis=1)], dtype=np.int64)
        vertices, local = np.unique(near, return_inverse=True)
        plain = build_topology(local.reshape(-1, 3), len(vertices))
        creased = with_creases(plain, np.searchsorted(vertices, creases))
        return cls(vertices, points[vertices], plain, creased)

    def moved(self, rule: Rule) -> Float[np.ndarray, " K"]:
        """Return how far a rule's answers lie apart with creases and without."""
        return norm(rule(self.points, self.creased) - rule(self.points, self.plain))

    def numbers_of(self, pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, " N"]:
        """Return which edges the pairs of the mesh's vertices are here."""
        count = np.int64(len(self.vertices))
        local = np.searchsorted(self.vertices, pairs)
        keys = self.plain.edges[:, 0] * count + self.plain.edges[:, 1]
        order = np.argsort(keys)
        wanted = local.min(axis=1) * count + local.max(axis=1)
        return order[np.searchsorted(keys, wanted, sorter=order)]
