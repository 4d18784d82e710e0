"""What the boundary's prior adds to Loop's curve rule, at boundary vertices and edges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array, dot, gather, namespace, scatter
from pns_common.connectivity.topology import EdgeClass
from pns_common.formula.boundary_prior import boundary_square, boundary_vertices
from pns_common.formula.correction import Correction, proximity_ratio, shortened
from pns_common.masks.stencils import MIDPOINT, loop_vertex_vertices
from pns_common.rules.control_level import ControlLevel
from pns_common.rules.placement import Placement
from pns_common.rules.scale_free_form import ScaleFreeForm


@dataclass(frozen=True)
class BoundaryRule:
    """What the boundary's prior adds to boundary vertices and edges; ``gate_sharpness`` is c_v."""

    form: ScaleFreeForm
    gate_sharpness: float

    def pushes(self, level: ControlLevel) -> Float[Array, "V 3"]:
        """Return d of the boundary's vertices, 0 elsewhere."""
        return self.form.boundary_strength * level.boundary_pushes(self.gate_sharpness)

    def move_vertices(self, level: ControlLevel, placed: Placement) -> Placement:
        """Move boundary vertices too: Loop's curve mask of the pushes, within ρ."""
        topology = level.topology
        movable = boundary_vertices(topology)
        rows = np.flatnonzero(movable)
        wanted = gather(loop_vertex_vertices(self.pushes(level), topology), rows)
        square = boundary_square(level.points, topology, rows)
        budget_per_length = level.budget_per_length(rows, self.form.budget)
        moved = self._within(placed, rows, wanted, budget_per_length * square)
        corrected = movable if placed.corrected is None else placed.corrected | movable
        return replace(moved, corrected=corrected)

    def move_edges(self, level: ControlLevel, placed: Placement) -> Placement:
        """Move boundary edges too: the mean of the pushes at their ends, within ρ."""
        rows = np.flatnonzero(level.topology.edge_class == EdgeClass.BOUNDARY)
        ends, pushes = level.topology.edges[rows], self.pushes(level)
        wanted = MIDPOINT * (gather(pushes, ends[:, 0]) + gather(pushes, ends[:, 1]))
        edge = gather(level.points, ends[:, 1]) - gather(level.points, ends[:, 0])
        budget_per_length = level.budget_per_length(ends[:, 0], self.form.budget)
        return self._within(placed, rows, wanted, budget_per_length * dot(edge, edge))

    def _within(
        self,
        placed: Placement,
        rows: Int[np.ndarray, " N"],
        wanted: Float[Array, "N 3"],
        envelope: Float[Array, " N"],
    ) -> Placement:
        """Add Π_ρ of what is wanted at rows where the placement had nothing; ρ is given."""
        xp, count = namespace(wanted), placed.loop.shape[0]
        moved = shortened(wanted, envelope)
        nothing = xp.zeros_like(envelope)
        made = Correction(moved, envelope, nothing, xp.zeros_like(nothing, dtype=xp.bool))
        displacement, bound = placed.displacement, placed.envelope
        assert displacement is not None  # a scale-free rule has placed them
        assert bound is not None
        return replace(
            placed,
            displacement=displacement + scatter(moved, rows, count),
            ratio=placed.ratio + scatter(proximity_ratio(made), rows, count),
            envelope=bound + scatter(envelope, rows, count),
        )
