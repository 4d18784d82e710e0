"""One level of refinement: both rules of a scheme, and the guard of what they add.

This is the step that ``refine`` takes in numpy and that training differentiates through in torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.arrays import Array, as_numpy, beside, namespace
from pns_common.boundary_prior import on_boundary
from pns_common.level import ControlLevel
from pns_common.loop_rules import loop_edge_rule, loop_vertex_rule
from pns_common.placement import Placement
from pns_common.schemes import Scheme
from pns_common.topology import split


@dataclass(frozen=True, eq=False)
class GuardRecord:
    """What the fold guard was given beside points and displacements, and what it took.

    Attributes:
        turns: for each old vertex the cosine of how far children at it may turn.
        first: the new vertices that were settled first, if any.
        refused: what was to be added to those whose s is 0, in their order.
    """

    turns: Float[np.ndarray, " V"]
    first: Bool[np.ndarray, " N"] | None
    refused: Float[np.ndarray, "M 3"]


@dataclass(frozen=True, eq=False)
class LevelStep:
    """What one level's rules placed.

    Attributes:
        vertices: the moved old vertices.
        edges: the edge vertices, numbered on from them.
        learned: whether the scheme's own rules made them; else Loop did.
        guard: s of the fold guard for all new vertices; None where there was nothing to guard.
        record: with it, what it takes to follow the guard again.
    """

    vertices: Placement
    edges: Placement
    learned: bool
    guard: Float[np.ndarray, " N"] | None
    record: GuardRecord | None = None

    @property
    def points(self) -> Float[Array, "N 3"]:
        """All new vertices, old vertices first."""
        return _joined(self.vertices.positions, self.edges.positions)

    @property
    def loop_points(self) -> Float[Array, "N 3"] | None:
        """Where Loop would have put them; None if they are there."""
        if self.vertices.displacement is None and self.edges.displacement is None:
            return None
        return _joined(self.vertices.loop, self.edges.loop)


def level_step(level: ControlLevel, scheme: Scheme) -> LevelStep:
    """Place the vertices of the next level.

    Raises:
        ModelError: the network returned something that is not finite, or of another shape.
    """
    if scheme.learned_levels is not None and level.depth >= scheme.learned_levels:
        return LevelStep(loop_vertex_rule(level), loop_edge_rule(level), False, None)
    step = LevelStep(scheme.vertex_rule(level), scheme.edge_rule(level), True, None)
    loop_points = step.loop_points
    if scheme.guard is None or loop_points is None:
        return step
    displacement = _joined(*(_displacement(rule) for rule in (step.vertices, step.edges)))
    # Boundaries first, so that what lies inside has no part in where they go.
    first = on_boundary(level.topology) if scheme.moves_boundaries else None
    turns = scheme.guard.cosines(level.topology, level.normals)
    cosines = cosines_of_children(turns, level.topology.faces)
    faces = split(level.topology)
    scale = scheme.guard(faces, loop_points, displacement, level.blocks, first, cosines)
    count = level.topology.vertex_count
    return replace(
        step,
        vertices=_scaled(step.vertices, scale[:count]),
        edges=_scaled(step.edges, scale[count:]),
        guard=scale,
        record=GuardRecord(turns, first, as_numpy(displacement)[scale == 0]),
    )


def cosines_of_children(
    turns: Float[np.ndarray, " V"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, " C"]:
    """Of how far each child of the faces may turn, from what stands at their corners."""
    return np.repeat(turns[faces].min(axis=1), 4)


def _scaled(placement: Placement, scale: Float[np.ndarray, " N"]) -> Placement:
    """The placement with s δ instead of δ."""
    if placement.displacement is None:
        return placement
    s = beside(placement.loop, scale, placement.loop.dtype)
    displacement = s[:, None] * placement.displacement
    return replace(placement, displacement=displacement, ratio=s * placement.ratio)


def _displacement(placement: Placement) -> Float[Array, "N 3"]:
    if placement.displacement is None:
        return namespace(placement.loop).zeros_like(placement.loop)
    return placement.displacement


def _joined(vertices: Float[Array, "V 3"], edges: Float[Array, "E 3"]) -> Float[Array, "N 3"]:
    return namespace(vertices, edges).concat([vertices, edges])
