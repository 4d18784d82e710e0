"""The limit of a refined mesh, from the connectivity of the mesh that was split.

An edge vertex is regular: six neighbours around it on an interior edge, four in each sector on any
other. So no ring has to be found in the refined mesh, which is four times as large. Where faces
have the same three vertices (connectivity/doubled_faces.py) it has two more sharp edges for these,
to the middles of their other sides: on a fold it runs along them, and elsewhere, where the halves
of its own edge are sharp too, it stays. Only around faces with a vertex twice rings are found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import (
    Array,
    beside,
    cross,
    gather,
    marked,
    namespace,
    scatter,
    unit,
)
from pns_common.base.blocks import WHOLE, Blocks
from pns_common.connectivity.creases import crease_children, with_creases
from pns_common.connectivity.doubled_faces import doubled_faces
from pns_common.connectivity.topology import (
    EdgeClass,
    Topology,
    build_topology,
    next_corner,
    split,
)
from pns_common.masks.limit.neighbours import split_neighbours
from pns_common.masks.limit.normals import (
    limit_normals,
    means_of_units,
    normals_of_vertices,
    plane_normals,
)
from pns_common.masks.limit.positions import limit_positions, limits_of_vertices
from pns_common.masks.stencils import CURVE_LIMIT_CENTRE, CURVE_LIMIT_NEIGHBOUR

# w_6 = 1/2, shared by six.
REGULAR_CENTRE, REGULAR_NEIGHBOUR = 1 / 2, 1 / 12
ROOT_3 = 3**0.5


def refined_limit_positions(
    points: Float[Array, "W K"], topology: Topology, blocks: Blocks = WHOLE
) -> Float[Array, "W K"]:
    """Return the limits of ``topology``'s split: of old vertices, then of edge vertices."""
    xp = namespace(points)
    count, edges = topology.vertex_count, topology.edges
    lying = doubled_faces(topology)

    def at_edges(rows: slice) -> tuple[Array]:
        middle = points[count:][rows]
        ends = gather(points, edges[rows, 0]) + gather(points, edges[rows, 1])
        limits = _on_curve(middle, ends)
        if lying is not None:
            limits = xp.where(beside(points, lying.corners[rows])[:, None], middle, limits)
        return (limits,)

    def at_interior(rows: slice) -> tuple[Array]:
        inside = topology.interior[rows]
        ring = [gather(points, row) for row in _rings(topology, inside)]
        middle = gather(points, count + inside)
        total = (ring[0] + ring[1]) + (ring[2] + ring[3]) + (ring[4] + ring[5])
        limits = REGULAR_CENTRE * middle + REGULAR_NEIGHBOUR * total
        if lying is not None:
            _, bc, ca, *_ = ring
            fold = beside(points, lying.folds[inside])[:, None]
            limits = xp.where(fold, _on_curve(middle, bc + ca), limits)
        return (limits,)

    (on_curve,) = blocks.gather(len(edges), at_edges)
    (inside,) = blocks.gather(len(topology.interior), at_interior)
    is_interior = beside(points, topology.edge_class == EdgeClass.INTERIOR)[:, None]
    middle = xp.where(is_interior, scatter(inside, topology.interior, len(edges)), on_curve)
    limits = xp.concat([limits_of_vertices(points, split_neighbours(topology)), middle])
    if lying is None or len(lying.collapsed) == 0:
        return limits
    around = _cut_out(topology, lying.collapsed)
    return around.put(limit_positions(gather(points, around.vertices), around.topology), limits)


def refined_limit_normals(
    points: Float[Array, "W 3"], topology: Topology, blocks: Blocks = WHOLE
) -> Float[Array, "W 3"]:
    """Return unit normals of the limit surface there; on creases the unit mean of both sides'."""
    xp = namespace(points)
    count = topology.vertex_count
    lying = doubled_faces(topology)

    def at_interior(rows: slice) -> tuple[Array]:
        edges = topology.interior[rows]
        middle = gather(points, count + edges)
        b, bc, ca, a, ad, db = (gather(points, row) - middle for row in _rings(topology, edges))
        first = (b - a) + (bc - ca - ad + db) / 2
        second = ROOT_3 / 2 * (bc + ca - ad - db)
        normals = plane_normals(first, second, cross(first, second))
        if lying is not None:
            # The two faces of a fold look opposite ways.
            fold = beside(points, lying.folds[edges])[:, None]
            normals = xp.where(fold, 0.0 * normals, normals)
        return (normals,)

    (inside,) = blocks.gather(len(topology.interior), at_interior)
    # + 0.0 also where nothing is added: beside a mesh with a boundary zeros keep their signs.
    normals = scatter(inside, topology.interior, len(topology.edges)) + 0.0
    edge_of_corner = topology.face_edges.reshape(-1)
    sharp = topology.edge_class[edge_of_corner] != EdgeClass.INTERIOR
    at_corners = sharp & (False if lying is None else lying.corners[edge_of_corner])
    beside_curves = np.flatnonzero(sharp & ~at_corners)
    if len(beside_curves):
        one_sided = _one_sided(points, topology, beside_curves)
        owners = edge_of_corner[beside_curves]
        normals = normals + means_of_units(one_sided, owners, len(topology.edges))
    if lying is not None and at_corners.any():
        beside_corners = np.flatnonzero(at_corners)

        def at_half_edges(rows: slice) -> tuple[Array]:
            return (_at_corners(points, topology, lying.doubled, beside_corners[rows]),)

        (sides,) = blocks.gather(len(beside_corners), at_half_edges)
        owners = np.repeat(edge_of_corner[beside_corners], 3)
        normals = normals + means_of_units(sides, owners, len(topology.edges))
    old = normals_of_vertices(points, split_neighbours(topology)).vertices
    limits = xp.concat([old, normals])
    if lying is None or len(lying.collapsed) == 0:
        return limits
    around = _cut_out(topology, lying.collapsed)
    found = limit_normals(gather(points, around.vertices), around.topology)
    return around.put(found.vertices, limits)


@dataclass(frozen=True, eq=False)
class _CutOut:
    """The part of a split around its irregular vertices, with all faces that these have there.

    Attributes:
        vertices: its vertices' numbers in the split.
        topology: its connectivity.
        irregular: its vertices that are the irregular ones.
    """

    vertices: Int[np.ndarray, " N"]
    topology: Topology
    irregular: Int[np.ndarray, " M"]

    def put(self, found: Float[Array, "N K"], limits: Float[Array, "W K"]) -> Float[Array, "W K"]:
        """Return limits with what was found of the irregular vertices in their rows."""
        rows, count = self.vertices[self.irregular], len(limits)
        is_irregular = marked(rows, count)
        spread = scatter(gather(found, self.irregular), rows, count)
        return namespace(limits).where(beside(limits, is_irregular)[:, None], spread, limits)


def _cut_out(topology: Topology, collapsed: Int[np.ndarray, " N"]) -> _CutOut:
    """Return the part of the split around the corners of faces with a vertex twice, and sides."""
    middles = topology.vertex_count + topology.face_edges[collapsed]
    rows = np.unique(np.concatenate([topology.faces[collapsed], middles]))
    is_irregular = marked(rows, topology.vertex_count + len(topology.edges))
    children, creases = split(topology), crease_children(topology)
    vertices, faces = np.unique(children[is_irregular[children].any(axis=1)], return_inverse=True)
    plain = build_topology(faces.reshape(-1, 3), len(vertices))
    # Of these alone every edge is here.
    near = np.searchsorted(vertices, creases[is_irregular[creases].any(axis=1)])
    return _CutOut(vertices, with_creases(plain, near), np.searchsorted(vertices, rows))


def _on_curve(middle: Float[Array, "N K"], ends: Float[Array, "N K"]) -> Float[Array, "N K"]:
    """Return the limit on a curve, from a vertex and the sum of those beside it."""
    return CURVE_LIMIT_CENTRE * middle + CURVE_LIMIT_NEIGHBOUR * ends


def _one_sided(
    points: Float[Array, "W 3"], topology: Topology, half_edges: Int[np.ndarray, " H"]
) -> Float[Array, "H 3"]:
    """Return normals at the middles of half-edges that are not interior, on their faces' side."""
    middle = gather(points, topology.vertex_count + topology.face_edges.reshape(-1)[half_edges])
    rows = _half_ring(topology, half_edges)
    b, bc, ca = (gather(points, row) - middle for row in rows)
    a = gather(points, topology.faces.reshape(-1)[half_edges]) - middle
    # The masks of three faces: 1, 0, 0, −1 along and −1, 2, 2, −1 across, −2 in the middle.
    area = cross(b, bc) + cross(bc, ca) + cross(ca, a)
    return plane_normals(b - a, 2 * (bc + ca) - (a + b), area)


def _at_corners(
    points: Float[Array, "W 3"],
    topology: Topology,
    doubled: Bool[np.ndarray, " F"],
    half_edges: Int[np.ndarray, " H"],
) -> Float[Array, "H*3 3"]:
    """Return the normals of the sectors on a half-edge's face, at a middle that stays.

    Rows 3 h … 3 h + 2 are half-edge h's. A doubled face has three sectors, each of one of its
    children, in their order; any other has one, and 0 in the rows after it.
    """
    xp = namespace(points)
    middle = gather(points, topology.vertex_count + topology.face_edges.reshape(-1)[half_edges])
    b, bc, ca = (gather(points, row) - middle for row in _half_ring(topology, half_edges))
    a = gather(points, topology.faces.reshape(-1)[half_edges]) - middle
    of_a, of_b, of_middle = cross(ca, a), cross(b, bc), cross(bc, ca)
    whole = plane_normals(b, a, of_a + of_b + of_middle, np.ones(len(half_edges), dtype=bool))
    # Where the half-edge is the last of its face, b is the first corner.
    turned = beside(points, half_edges % 3 == 2)[:, None]
    earlier, later = xp.where(turned, of_b, of_a), xp.where(turned, of_a, of_b)
    is_doubled = beside(points, doubled[half_edges // 3])[:, None]
    sectors = [
        xp.where(is_doubled, unit(earlier), whole),
        xp.where(is_doubled, unit(later), 0.0 * whole),
        xp.where(is_doubled, unit(of_middle), 0.0 * whole),
    ]
    return xp.reshape(xp.stack(sectors, axis=1), (-1, 3))


def _rings(topology: Topology, edges: Int[np.ndarray, " N"]) -> list[Int[np.ndarray, " N"]]:
    """Return the six neighbours of the middle of interior edges, anticlockwise."""
    sides = topology.half_edges[edges]
    return [row for side in (0, 1) for row in _half_ring(topology, sides[:, side])]


def _half_ring(
    topology: Topology, half_edges: Int[np.ndarray, " H"]
) -> list[Int[np.ndarray, " H"]]:
    """Return b and the middles of bc and ca, around the middle of half-edge a → b of abc."""
    following = next_corner(half_edges)
    middles = topology.vertex_count + topology.face_edges.reshape(-1)
    after = topology.faces.reshape(-1)[following]
    return [after, middles[following], middles[next_corner(following)]]
