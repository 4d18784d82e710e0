"""How far a mesh's vertices at creases lie from where Loop's smooth rules would have put them.

The learned correction is measured from Loop with the same creases, which keeps a creased edge at
its middle and a corner where it is; so what a report says of the distance to Loop itself counts
this in: all of it, with what was added to such a vertex.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import marked, norm
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.edges_alone import edges_alone
from pns_common.connectivity.topology import EdgeClass, build_topology, vertices_across
from pns_common.masks.limit.positions import limit_positions
from pns_common.masks.stencils import loop_edge_point, loop_vertex_vertices

# Compared in 64 bits an enumeration's members take seven times as long.
INTERIOR, CREASE = int(EdgeClass.INTERIOR), int(EdgeClass.CREASE)


@dataclass(frozen=True, eq=False)
class CreaseShift:
    """Vertices at creases, and how far they moved; creases, and how far their vertices did.

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
    edges: Int[np.ndarray, "E 2"],
    half_edges: Int[np.ndarray, "E 2"],
    edge_class: Int[np.ndarray, " E"],
    rows: Int[np.ndarray, " N"],
    placed: Float[np.ndarray, "W 3"],
) -> CreaseShift | None:
    """Return how far from Loop's smooth rules a step placed what lies at creases; None without.

    ``rows`` are their numbers among the level's edges; the others as ``Topology`` has them, ends in
    any order. ``placed`` are all vertices of the next level.
    """
    if len(rows) == 0:
        return None
    middle = shift_of_edges(points, faces, edges, half_edges, rows, placed)
    at_creases = marked(edges[rows].reshape(-1), len(points))
    around = np.flatnonzero(at_creases[edges[:, 0]] | at_creases[edges[:, 1]])
    classes = edge_class[around]
    smooth_class = np.where(classes == CREASE, INTERIOR, classes)
    near, plain = edges_alone(edges[around], smooth_class, len(points))
    known = at_creases[near]
    vertices, smooth = near[known], loop_vertex_vertices(points[near], plain)[known]
    return CreaseShift(vertices, norm(placed[vertices] - smooth), rows, middle)


def shift_of_edges(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    edges: Int[np.ndarray, "E 2"],
    half_edges: Int[np.ndarray, "E 2"],
    rows: Int[np.ndarray, " N"],
    placed: Float[np.ndarray, "W 3"],
) -> Float[np.ndarray, " N"]:
    """Return how far from Loop's smooth rule the vertices of some edges between two faces lie."""
    ends = edges[rows]
    across = vertices_across(faces, ends, half_edges[rows])
    a, b, c, d = (np.take(points, column, axis=0) for column in (*ends.T, *across.T))
    return norm(placed[len(points) + rows] - loop_edge_point(a, b, c, d))


def limit_crease_shift(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Int[np.ndarray, "N 2"],
) -> CreaseShift | None:
    """Return how far creases move a mesh's limits; None without creases."""
    if len(creases) == 0:
        return None
    at_creases = marked(creases.reshape(-1), len(points))
    # There every vertex at a crease has its whole ring; of others nothing differs.
    near = np.asarray(faces[at_creases[faces].any(axis=1)], dtype=np.int64)
    vertices, local = np.unique(near, return_inverse=True)
    plain = build_topology(local.reshape(-1, 3), len(vertices))
    creased = with_creases(plain, np.searchsorted(vertices, creases))
    moved = norm(
        limit_positions(points[vertices], creased) - limit_positions(points[vertices], plain)
    )
    nothing = np.zeros(0, dtype=np.int64)
    return CreaseShift(vertices, moved, nothing, np.zeros(0))
