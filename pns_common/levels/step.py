"""One level of refinement: both rules of a scheme, and the guard of what they add.

This is the step that ``refine`` takes in numpy and that training differentiates through in torch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pns_common.base.arrays import Array, beside, namespace
from pns_common.connectivity.topology import split
from pns_common.errors import ParameterError
from pns_common.formula.curve_prior import on_boundary
from pns_common.rules.control_level import ControlLevel, Rule
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from pns_common.rules.placement import Added, Placement
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class AddedStep:
    """What one level's rules added to Loop's vertices.

    Attributes:
        vertices: of the moved old vertices.
        edges: of the edge vertices, numbered on from them.
        learned: whether the scheme's own rules made them; else Loop did.
        guard: s of the fold guard for all new vertices; None where there was nothing to guard.
    """

    vertices: Added
    edges: Added
    learned: bool
    guard: Float[np.ndarray, " N"] | None


@dataclass(frozen=True, eq=False)
class LevelStep(AddedStep):
    """What one level's rules placed."""

    vertices: Placement
    edges: Placement

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
        ParameterError: a rule returned no placement, or one of other vertices.
    """
    if not scheme.acts_at(level.depth):
        return LevelStep(loop_vertex_rule(level), loop_edge_rule(level), False, None)
    vertices = _placed("vertex_rule", scheme.vertex_rule, level, level.topology.vertex_count)
    edges = _placed("edge_rule", scheme.edge_rule, level, len(level.topology.edges))
    step = LevelStep(vertices, edges, True, None)
    loop_points = step.loop_points
    if scheme.guard is None or loop_points is None:
        return step
    displacement = _joined(*(_displacement(rule) for rule in (step.vertices, step.edges)))
    shared = on_boundary(level.topology) if scheme.moves_boundaries else None
    scale = scheme.guard(split(level.topology), loop_points, displacement, level.blocks, shared)
    count = level.topology.vertex_count
    return replace(
        step,
        vertices=_scaled(step.vertices, scale[:count]),
        edges=_scaled(step.edges, scale[count:]),
        guard=scale,
    )


def _placed(name: str, rule: Rule, level: ControlLevel, count: int) -> Placement:
    """Return what a rule placed: anyone may write one."""
    placed = rule(level)
    if not isinstance(placed, Placement):  # pyright: ignore[reportUnnecessaryIsInstance]
        expected = "a rule that returns a Placement, as placed_at makes it"
        raise ParameterError(name, type(placed), expected=expected)
    if placed.loop.shape != (count, 3):
        expected = f"a rule that places the {count} vertices that are its own"
        raise ParameterError(name, tuple(placed.loop.shape), expected=expected)
    return placed


def _scaled(placement: Placement, scale: Float[np.ndarray, " N"]) -> Placement:
    """Return the placement with s δ instead of δ."""
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
