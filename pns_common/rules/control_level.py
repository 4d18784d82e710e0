"""What a rule may look at: one level's mesh, before refinement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import Array
from pns_common.base.blocks import WHOLE, Blocks
from pns_common.base.cached import cached_property
from pns_common.connectivity.topology import Topology
from pns_common.formula.correction import BudgetPerLength
from pns_common.formula.curve_prior import Curves, Kinds, curve_pushes, find_curves
from pns_common.formula.prior import normal_pushes
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings
from pns_common.geometry.thin_faces import NetworkLengths, network_lengths
from pns_common.rules.placement import Placement


@dataclass(frozen=True, eq=False)
class ControlLevel:
    """One level's mesh, before refinement; numpy arrays, or torch tensors that keep a gradient.

    Attributes:
        points: its vertices.
        topology: its connectivity.
        normals: unit normals of its faces, 0 where they have no area.
        reference_length: R, the unit of length of the budget, fixed at level 0; 0 switches
            corrections off. Of the whole mesh, or of each vertex, where parts that share no vertex
            have their own.
        blocks: how row-wise work is divided; tensors take all rows at once.
        depth: 0 for the control mesh, 1 for what the first step made of it, …
    """

    points: Float[Array, "V 3"]
    topology: Topology
    normals: Float[Array, "F 3"]
    reference_length: float | Float[np.ndarray, " V"]
    blocks: Blocks = WHOLE
    depth: int = 0

    def budget_per_length(self, vertices: Int[np.ndarray, " N"], budget: float) -> BudgetPerLength:
        """Return C / R at some vertices: one number where the whole mesh has one R."""
        if isinstance(self.reference_length, np.ndarray):
            return budget / self.reference_length[vertices]
        return budget / self.reference_length

    @cached_property
    def rings(self) -> Rings:
        """The rings of all vertices, each part computed when it is first asked for, and once."""
        return Rings(self.topology, self.points, self.normals)

    @cached_property
    def pushes(self) -> Float[Array, "V 3"]:
        """d_v of the prior at s = 1, likewise."""
        return normal_pushes(self.rings)

    @cached_property
    def network_lengths(self) -> Callable[[float | None], NetworkLengths]:
        """ℓ of the scale-free rules as a function of α: computed once, since both have the same."""
        return cache(partial(network_lengths, self.rings))

    @cached_property
    def curves(self) -> Callable[[Kinds], Curves]:
        """The curves of edges of some kinds: found once, read by both rules."""
        return cache(partial(find_curves, self.points, self.topology))

    @cached_property
    def curve_pushes(self) -> Callable[[float, Kinds], Float[Array, "V 3"]]:
        """d of the curves' prior at b = 1, by c_v and kinds: computed once, read four times."""

        def pushes(gate_sharpness: float, kinds: Kinds) -> Float[Array, "V 3"]:
            return curve_pushes(self.curves(kinds), gate_sharpness)

        return cache(pushes)


def control_level(
    points: Float[Array, "V 3"],
    topology: Topology,
    reference_length: float = 1.0,
    depth: int = 0,
) -> ControlLevel:
    """Make a level of its points alone, on any backend: what training starts a step with."""
    normals = face_normals(points, topology.faces)
    return ControlLevel(points, topology, normals, reference_length, depth=depth)


Rule = Callable[[ControlLevel], Placement]
