"""The prior of curves beside the kernels: its rule is the array kernels', on the few it moves.

The rule knows curves alone, so it is given a level of the vertices on sharp edges, and of those
edges: what it makes of them is what it makes of them in the whole mesh, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import gather
from pns_common.connectivity.edges_alone import edges_alone
from pns_common.formula.correction import Correction, proximity_ratio
from pns_common.formula.curve_prior import are_of, on_boundary
from pns_common.fused.additions import Additions
from pns_common.fused.mesh_edges import MeshEdges
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.curves import CurveRule


@dataclass(frozen=True, eq=False)
class SharpLevel:
    """A level's sharp edges by themselves.

    Attributes:
        level: their vertices and themselves, numbered on their own in the same order.
        vertices, edges: which they are in the whole mesh.
    """

    level: ControlLevel
    vertices: Int[np.ndarray, " N"]
    edges: Int[np.ndarray, " S"]

    @classmethod
    def of(
        cls,
        points: Float[np.ndarray, "V 3"],
        mesh: MeshEdges,
        length: float | Float[np.ndarray, " V"],
    ) -> SharpLevel:
        """Take the sharp edges of a mesh; ``length`` is R, or each vertex's own."""
        edges, no_normals = mesh.sharp_edges, np.zeros((0, 3))
        of_edges = mesh.edges[edges], mesh.edge_class[edges]
        vertices, topology = edges_alone(*of_edges, len(points))
        own = length[vertices] if isinstance(length, np.ndarray) else length
        return cls(ControlLevel(points[vertices], topology, no_normals, own), vertices, edges)


@dataclass(frozen=True, eq=False)
class CurveMoves:
    """What a rule makes of a level's curves.

    Attributes:
        rule, sharp: None where there is no rule, or no curve.
        pushes: of all vertices; (0, 3) where none is of a curve, and none moves.
        nothing: what is added in their place: 0, or −0 where there is no rule.
    """

    rule: CurveRule | None
    sharp: SharpLevel | None
    pushes: Float[np.ndarray, "P 3"]
    nothing: float

    def move_vertices(self, loop: Float[np.ndarray, "V 3"], added: Additions) -> None:
        """Add to curves' vertices, which Loop puts at ``loop``."""
        if len(self.pushes) and self.rule is not None and self.sharp is not None:
            level = self.sharp.level
            rows = self.sharp.vertices[level.curves(self.rule.kinds).rows]
            _add(self.rule.at_vertices(level, gather(loop, rows)), rows, added)
            if added.corrected is not None:
                added.corrected[rows] = True

    def move_edges(self, added: Additions) -> None:
        """Add to curves' edges likewise."""
        if len(self.pushes) and self.rule is not None and self.sharp is not None:
            level = self.sharp.level
            rows = self.sharp.edges[level.curves(self.rule.kinds).edges]
            _add(self.rule.at_edges(level), rows, added)

    def shared(self, vertex_count: int, edge_count: int) -> Bool[np.ndarray, " W"] | None:
        """Return what the fold guard takes for shared with other pieces; None where nothing is."""
        if self.sharp is None:
            return None
        alone = on_boundary(self.sharp.level.topology)
        if not alone.any():
            return None
        shared = np.zeros(vertex_count + edge_count, dtype=bool)
        shared[self.sharp.vertices] = alone[: len(self.sharp.vertices)]
        shared[vertex_count + self.sharp.edges] = alone[len(self.sharp.vertices) :]
        return shared


NO_RULE = CurveMoves(None, None, np.zeros((0, 3)), -0.0)


def curves_of(
    rule: CurveRule | None,
    points: Float[np.ndarray, "V 3"],
    mesh: MeshEdges,
    length: float | Float[np.ndarray, " V"],
) -> CurveMoves:
    """Make what ``rule`` adds at a level's curves; ``length`` is R, or each vertex's own."""
    if rule is None:
        return NO_RULE
    if not are_of(rule.kinds, mesh.edge_class[mesh.sharp_edges]).any():
        return CurveMoves(rule, None, np.zeros((0, 3)), 0.0)
    sharp = SharpLevel.of(points, mesh, length)
    if len(sharp.level.curves(rule.kinds).rows) == 0:
        return CurveMoves(rule, sharp, np.zeros((0, 3)), 0.0)
    pushes = np.zeros(points.shape)
    pushes[sharp.vertices] = rule.pushes(sharp.level)
    return CurveMoves(rule, sharp, pushes, 0.0)


def _add(made: Correction, rows: Int[np.ndarray, " N"], added: Additions) -> None:
    """Write what is added at rows where nothing was; no 0 has a sign there."""
    added.displacement[rows] = 0.0 + made.displacement
    added.ratio[rows] = proximity_ratio(made)
    added.envelope[rows] = made.envelope
