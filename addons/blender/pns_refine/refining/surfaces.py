"""A refined surface with all that it carries: of whole levels, or of faces of several.

Both kinds have the same members: ``topology`` of the refined faces; ``edge_parents``, the control
edge that each edge is a piece of (−1 inside faces); ``face_parents``; ``sharp``, flags of the edges
that are sharp on the surface; ``ratio`` and ``gate`` of the last learned level; ``at_vertices`` and
``at_corners``, which refine a column; and ``normals`` of corners, one-sided along sharp edges.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from pns_common import Refinement
from pns_common.adaptive.polygon_refinement import PolygonRefinement
from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry import rules
from pns_common.carry.carried import (
    BLENDING,
    Carrier,
    Column,
    edge_parents,
    refine_column,
    scaled_to_unit,
)
from pns_common.mesh.normals import measure_faces
from pns_common.mesh.rows import cross, dot, norm
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import MOSTLY_SHARP, Topology, following
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes.limit import limit_normals


class WholeLevels:
    """All faces are of one level."""

    def __init__(self, made: Refinement) -> None:
        self._made, base, blocks = made, made.scheme.base, Blocks(available_threads())
        carrier = Carrier(made.topologies, base, made.normals is not None, blocks)
        self.topology, self.face_parents = carrier.last, carrier.face_parents
        self.edge_parents = edge_parents(made.topologies, carrier.last)
        self.sharp = carrier.last.is_sharp
        self.at_vertices, self.at_corners = carrier.at_vertices, carrier.at_corners
        self.ratio, self.gate = made.ratio, made.gate
        for depth, step in enumerate(made.steps, 1):
            if step.added is not None:
                # New vertices of later levels have a mean.
                self.ratio, self.gate = (
                    refine_column(Column(values), made.topologies[depth:], base)
                    for values in (step.added.ratio, step.added.gate)
                )

    def normals(self, sharp: Bool[np.ndarray, " E"]) -> Float[np.ndarray, "C 3"]:
        """Return the limit surface's normal at each corner, one-sided along sharp edges."""
        made, blocks = self._made, Blocks(available_threads())
        topology = self.topology.with_creases(np.flatnonzero(sharp))
        found = limit_normals(made.steps[-1].points, topology, blocks, made.scheme.base)
        normals = found.sectors[found.sector_of_corner]
        # Where the surface has none its face has one.
        faces, _ = measure_faces(made.mesh.vertices, topology, blocks, areas=False)
        owner = topology.face_of(np.arange(len(normals)))
        return np.where(normals.any(axis=1)[:, None], normals, faces[owner])


class SeveralLevels:
    """Faces are cut only where the surface bends.

    At corners values are linear in triangles, and bilinear in the quads that polygons become first.
    """

    def __init__(self, made: AdaptiveRefinement) -> None:
        self._made, cage = made, made.control.topology
        self.topology, self.face_parents = made.mesh.topology(), made.face_parents
        self.edge_parents = self._side_parents(cage)
        parents = self.edge_parents
        self.sharp = (parents >= 0) & (cage.sharpness > MOSTLY_SHARP)[parents]
        self.ratio = self.gate = np.zeros(len(made.mesh.vertices))

    def _side_parents(self, cage: Topology) -> Int[np.ndarray, " E"]:
        made, topology = self._made, self.topology
        parents = np.full(len(topology.edges), -1, dtype=np.int64)
        if isinstance(made, PolygonRefinement):
            parents[topology.corner_edges] = made.edge_parents
            return parents
        both = np.stack([made.weights, np.roll(made.weights, -1, axis=1)])
        # Of a point on a side the weight of the corner opposite is 0.
        rows, corner, opposite = np.nonzero((both == 0).all(axis=0))
        sides = cage.face_edges[made.face_parents[rows], (opposite + 1) % 3]
        parents[topology.face_edges[rows, corner]] = sides
        return parents

    def at_vertices(self, column: Column) -> Shaped[np.ndarray, "W K"]:
        """Refine values at vertices; labels are those of the heaviest parent."""
        values, made = column.values, self._made
        if column.rule is rules.smooth:
            carried = made.carry(values)
            return scaled_to_unit(carried) if column.unit else carried
        count = len(made.mesh.vertices)
        if column.rule is rules.old:
            return np.concatenate([values, np.zeros((count - len(values), *values.shape[1:]))])
        # Of equals the smallest.
        parents = made.parents
        keys = -values[parents.columns, 0].astype(np.float64), np.round(parents.weights, 6)
        order = np.lexsort((*keys, parents.rows))
        return values[parents.columns[order[parents.starts[1:] - 1]]]

    def at_corners(self, column: Column) -> Shaped[np.ndarray, "C K"]:
        """Refine values at corners of the control mesh to those of the refined faces."""
        values, made = column.values, self._made
        if column.rule in BLENDING:
            carried = made.at_corners(values).reshape(-1, values.shape[1])
            return scaled_to_unit(carried) if column.unit else carried
        if isinstance(made, PolygonRefinement):
            return values[made.nearest_corners]
        nearest = 3 * made.face_parents[:, None] + made.weights.argmax(axis=2)
        return values[nearest.reshape(-1)]

    def normals(self, sharp: Bool[np.ndarray, " E"]) -> Float[np.ndarray, "C 3"]:
        """Return the limit surface's normal at each corner; along sharp edges that of its side."""
        points, mesh, blocks = self._made.mesh.vertices, self.topology, Blocks(available_threads())
        fans = find_sectors(mesh.with_creases(np.flatnonzero(sharp)).connectivity).of_corner
        faces, _ = measure_faces(points, mesh, blocks, areas=False)
        # Weighted by their angles: however a flat side is cut, it weighs the same.
        after = following(mesh.offsets)
        leave = points[mesh.corners[after]] - points[mesh.corners]
        enter = np.empty_like(leave)
        enter[after] = -leave
        angles = np.arctan2(norm(cross(leave, enter)), dot(leave, enter))[:, None]
        weighted = angles * faces[mesh.face_of(np.arange(len(after)))]
        sides = np.stack([np.bincount(fans, column) for column in weighted.T], axis=1)
        own = np.asarray(self._made.normals)[mesh.corners]
        several = np.isin(mesh.corners, mesh.edges[sharp]) | ~own.any(axis=1)
        return np.where(several[:, None], scaled_to_unit(sides)[fans], own)


Surface = WholeLevels | SeveralLevels
