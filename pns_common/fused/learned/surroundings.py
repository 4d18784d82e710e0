"""What a learned level reads of its mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import BLOCK_ROWS, Blocks
from pns_common.base.cached import cached_property
from pns_common.fused.learned.budgets import budgets_per_length
from pns_common.fused.learned.curves import NO_RULE, CurveMoves
from pns_common.fused.learned.edge_measures import EdgeMeasures, edge_measures, log_lengths
from pns_common.fused.learned.rings import (
    RingMeasures,
    measure_bends,
    measure_pushes,
    measure_rings,
)
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.fused.levels.mesh_edges import MeshEdges


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A level's mesh with what the rules ask of it: each part computed once, if it is asked for.

    ``reference_length`` is R > 0, the unit of length of the budget: of the whole mesh, or of each
    vertex, where parts that share no vertex have their own. ``altitudes`` is α of the network's
    lengths, infinite where these are h whatever the faces; ``prior_strength`` is s, likewise of the
    whole mesh or of each vertex.
    """

    points: Float[np.ndarray, "V 3"]
    mesh: MeshEdges
    faces: FaceMeasures
    multi_fan_vertices: Bool[np.ndarray, " V"]
    reference_length: float | Float[np.ndarray, " V"]
    blocks: Blocks
    curves: CurveMoves = NO_RULE
    altitudes: float = math.inf
    prior_strength: float | Float[np.ndarray, " V"] = 1.0

    def budget_per_length(
        self, vertices: Int[np.ndarray, " N"], budget: float
    ) -> Float[np.ndarray, " N"]:
        """Return C / R at each of some vertices."""
        return budgets_per_length(budget, self.reference_length, vertices)

    def prior_strengths(self, vertices: Int[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return s at each of some vertices."""
        if isinstance(self.prior_strength, np.ndarray):
            return self.prior_strength[vertices]
        return np.full(len(vertices), self.prior_strength)

    @cached_property
    def edges(self) -> EdgeMeasures:
        """What all edges are like."""
        return edge_measures(self.points, self.mesh, self.faces, self.altitudes, self.blocks)

    @cached_property
    def rings(self) -> RingMeasures:
        """The rings of all vertices."""
        around = self.points, self.mesh, self.faces, self.edges, self.multi_fan_vertices
        made = measure_rings(*around, self.blocks)
        # Nothing else reads them: an eighth of all memory.
        self.faces.forget_areas()
        vars(self)["edges"] = self.edges.without_bends()
        return made

    def forget_rings(self) -> None:
        """Let go of the largest table, which nothing at edges reads: a fifth of all memory."""
        if "rings" in vars(self):
            # Made of them, and read at edges.
            _ = self.pushes
            vars(self)["rings"] = replace(self.rings, means=self.rings.means[:0].copy())

    @cached_property
    def pushes(self) -> Float[np.ndarray, "V 3"]:
        """The prior's d_v at s = 1."""
        return measure_pushes(self.rings, self.blocks)

    @cached_property
    def bends(self) -> Float[np.ndarray, " F"]:
        """b of the gates that read sides."""
        made = measure_bends(self.edges.jumps, self.mesh, self.blocks)
        # Nothing else reads them.
        vars(self)["edges"] = self.edges.without_jumps()
        return made

    @cached_property
    def logs(self) -> Float[np.ndarray, " E"]:
        """The logarithms of the edges' lengths."""
        return log_lengths(self.edges.lengths, self.blocks)

    @property
    def network_blocks(self) -> Blocks:
        """How rows are divided that a network sees: as the array kernels divide them."""
        return self.blocks.of_rows(min(BLOCK_ROWS, self.blocks.rows))
