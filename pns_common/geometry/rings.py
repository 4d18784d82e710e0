"""What is measured of the ring of an old vertex, and three vectors that turn with it.

Everything is a mean over the spokes p_j − p_v of a vertex, so nothing depends on where the ring
starts, on its direction or on its length. With n, n' the unit normals on both sides of a spoke,
T its direction, m_v the mean normal of the faces and u_v, h_v the mean and the root mean square of
the spokes:

    x = ‖n − n'‖² / 2          (= 1 − n · n', without its rounding: 0 on any plane to 1e-31)
    s = (n × n') · T           positive on a crest, whichever end it is read from
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import (
    Array,
    beside,
    cross,
    dot,
    gather,
    namespace,
    norm,
    segment_sum,
    unit,
)
from pns_common.base.cached import cached_property
from pns_common.connectivity.edge_order import left_face_order
from pns_common.connectivity.topology import Topology, sharp_edge_count
from pns_common.geometry.ring_sums import divided, mean_normals, neighbour_mean, spokes


@dataclass(frozen=True, eq=False)
class Rings:
    """The rings of all V vertices; S = 2 E spokes, two for each edge.

    Every quantity is computed when it is first asked for, and kept.
    """

    topology: Topology
    points: Float[Array, "V 3"]
    face_normals: Float[Array, "F 3"]

    @cached_property
    def spokes(self) -> Float[Array, "S 3"]:
        """p_j − p_v."""
        return spokes(self.points, self.topology)

    @cached_property
    def normal(self) -> Float[Array, "V 3"]:
        """m_v, ‖m_v‖ ≤ 1."""
        return mean_normals(self.points, self.topology.faces)

    @cached_property
    def umbrella(self) -> Float[Array, "V 3"]:
        """u_v."""
        return self.mean(self.spokes)

    @cached_property
    def square(self) -> Float[Array, "V 1"]:
        """h_v²."""
        return self.mean(squared(self.spokes))

    @property
    def edge_squares(self) -> Float[Array, " E"]:
        """Squared lengths of all edges."""
        spokes = self.spokes[::2]
        return dot(spokes, spokes)

    @cached_property
    def double_areas(self) -> Float[Array, " F"]:
        """Twice the areas of the faces."""
        faces = self.topology.faces
        a, b, c = (gather(self.points, faces[:, corner]) for corner in range(3))
        return norm(cross(b - a, c - a))

    @property
    def jump(self) -> Float[Array, "S 1"]:
        """x of each spoke; 0 where it is not interior or a face has no area."""
        return self._across_edges[0]

    @property
    def edge_jumps(self) -> Float[Array, " E"]:
        """x of each edge, likewise."""
        return self.jump[::2, 0]  # both spokes of an edge stand side by side, with the same x

    @property
    def bend(self) -> Float[Array, "S 1"]:
        """s of each spoke; likewise."""
        return self._across_edges[1]

    @cached_property
    def mean_jump(self) -> Float[Array, "V 1"]:
        """The mean of x."""
        return self.mean(self.jump)

    @cached_property
    def near_jump(self) -> Float[Array, "V 1"]:
        """The mean of that at the neighbours."""
        return self.mean(self.of_neighbour(self.mean_jump))

    @cached_property
    def spoke_length(self) -> Float[Array, "V 1"]:
        """h_v, with gradient 0 at 0."""
        return root(self.square)

    @cached_property
    def height(self) -> Float[Array, "V 1"]:
        """u_v · m_v / h_v; 0 on boundary, irregular and crease edges."""
        # An open ring leans to one side: its umbrella says nothing of curvature.
        closed = beside(self.points, sharp_edge_count(self.topology) == 0)[:, None]
        lean = dot(self.umbrella, self.normal)[:, None]
        return namespace(lean).where(closed, divided(lean, self.spoke_length), 0.0)

    def mean(self, values: Float[Array, "S K"]) -> Float[Array, "V K"]:
        """Return the mean over each vertex's spokes."""
        return neighbour_mean(values, self.topology)

    def mean_of_edges(self, values: Float[Array, " E"]) -> Float[Array, "V 1"]:
        """Return the same of what both directions of an edge have in common."""
        both = np.repeat(np.arange(len(self.topology.edges)), 2)
        return self.mean(gather(values[:, None], both))

    def of_neighbour(self, values: Float[Array, "V K"]) -> Float[Array, "S K"]:
        """Return for each spoke the value at its far end."""
        return gather(values, self.topology.edges[:, ::-1].reshape(-1))

    def of_centre(self, values: Float[Array, "V K"]) -> Float[Array, "S K"]:
        """Return for each spoke the value at its near end."""
        return gather(values, self.topology.edges.reshape(-1))

    @cached_property
    def _across_edges(self) -> tuple[Float[Array, "S 1"], Float[Array, "S 1"]]:
        return _across_edges(self.points, self.face_normals, self.topology)


def squared(vectors: Float[Array, "N 3"]) -> Float[Array, "N 1"]:
    """Return the squared lengths of vectors."""
    return dot(vectors, vectors)[:, None]


def root(square: Float[Array, "N 1"]) -> Float[Array, "N 1"]:
    """Return the square root, with gradient 0 at 0."""
    xp = namespace(square)
    positive = square > 0
    return xp.where(positive, xp.sqrt(xp.where(positive, square, 1.0)), 0.0)


def ring_vectors(rings: Rings) -> Float[Array, "V 3 3"]:
    """Return e1, e2, e3 of each vertex, polar vectors that turn with the mesh, at most 1 long.

    e1 = m_v, e2 = u_v / h_v, e3 = mean of (x / 2) (p_j − p_v) / h_v. None is normalised: each is
    Lipschitz also where a symmetric ring makes it vanish.
    """
    pull = rings.mean(rings.jump / 2 * rings.spokes)
    length = rings.spoke_length
    rows = [rings.normal, divided(rings.umbrella, length), divided(pull, length)]
    return namespace(rings.normal).stack(rows, axis=1)


def _across_edges(
    points: Float[Array, "V 3"], normals: Float[Array, "F 3"], topology: Topology
) -> tuple[Float[Array, "S 1"], Float[Array, "S 1"]]:
    """Return x and s of each spoke: both directions of an edge have the same."""
    xp = namespace(points)
    left = left_face_order(topology, topology.interior)
    first, second = (gather(normals, left.faces[:, side]) for side in (0, 1))
    direction = unit(gather(points, left.stencil[:, 1]) - gather(points, left.stencil[:, 0]))
    defined = ((dot(first, first) > 0) & (dot(second, second) > 0))[:, None]
    difference = first - second
    jump = xp.where(defined, squared(difference) / 2, 0.0)
    bend = dot(cross(first, second), direction)[:, None]
    return _on_spokes(jump, topology), _on_spokes(bend, topology)


def _on_spokes(values: Float[Array, "I 1"], topology: Topology) -> Float[Array, "S 1"]:
    """Return values of interior edges at both spokes of each edge; 0 at other edges."""
    edges: Int[np.ndarray, " S"] = np.repeat(np.arange(len(topology.edges)), 2)
    return gather(segment_sum(values, topology.interior, len(topology.edges)), edges)
