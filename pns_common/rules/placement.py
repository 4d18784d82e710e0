"""Where a rule puts its vertices: Loop's positions, and what is added to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import Array, as_numpy, namespace, scatter
from pns_common.base.blocks import Blocks
from pns_common.errors import ParameterError
from pns_common.formula.correction import Correction, proximity_ratio


@runtime_checkable
class Added(Protocol):
    """What a rule added to Loop's N vertices, as far as reports ask; see ``Placement``."""

    @property
    def displacement(self) -> Float[Array, "N 3"] | None:
        """δ; None where the rule is Loop's."""
        ...

    @property
    def ratio(self) -> Float[Array, " N"]:
        """Proximity ratio."""
        ...

    @property
    def gate(self) -> Float[Array, " N"]:
        """γ."""
        ...

    @property
    def degenerate(self) -> Bool[Array, " N"]:
        """Vertices whose frame was the fallback."""
        ...

    @property
    def corrected(self) -> Bool[Array, " N"] | None:
        """Vertices that a rule may move which is not Loop's."""
        ...

    @property
    def envelope(self) -> Float[Array, " N"] | None:
        """ρ; None where the rule names no bound."""
        ...

    def rows(self, rows: slice | Int[np.ndarray, " N"]) -> Added:
        """Return some of the vertices."""
        ...


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a rule puts its N vertices: Loop's position plus a displacement.

    Attributes:
        loop: Loop's positions q0.
        displacement: what is added to them; None where the rule is Loop's.
        ratio: proximity ratio ‖δ‖ R / (C h²), 0 for Loop.
        gate: γ, 0 where there is no correction.
        degenerate: vertices whose frame was the fallback.
        corrected: of a vertex rule that is not Loop's, the vertices that it may move.
        envelope: the longest that δ may be, ρ = C h² / R, or 0 where a gate is shut; None where the
            rule names no bound.
    """

    loop: Float[Array, "N 3"]
    displacement: Float[Array, "N 3"] | None
    ratio: Float[Array, " N"]
    gate: Float[Array, " N"]
    degenerate: Bool[Array, " N"]
    corrected: Bool[Array, " N"] | None = None
    envelope: Float[Array, " N"] | None = None

    @property
    def positions(self) -> Float[Array, "N 3"]:
        """q = q0 + δ."""
        return self.loop if self.displacement is None else self.loop + self.displacement

    def rows(self, rows: slice | Int[np.ndarray, " N"]) -> Placement:
        """Return some of the vertices; of arrays, views for a slice and copies for indices."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return Placement(**{n: None if v is None else v[rows] for n, v in values.items()})


def without_correction(positions: Float[Array, "N 3"]) -> Placement:
    """Make a placement that is Loop's: reports count it as no distance to Loop."""
    xp = namespace(positions)
    nothing = xp.zeros_like(positions[:, 0])
    return Placement(positions, None, nothing, nothing, xp.zeros_like(nothing, dtype=xp.bool))


def placed_at(loop: Placement, positions: Array) -> Placement:
    """Put vertices at (N, 3) positions, without a bound: reports count how far that is from Loop's.

    Raises:
        ParameterError: there is not one position for each of Loop's, or they are no real numbers.
    """
    if np.shape(positions) != tuple(loop.loop.shape):
        expected = f"an array of shape {tuple(loop.loop.shape)}, a row for each vertex"
        raise ParameterError("positions", np.shape(positions), expected=expected)
    kind = np.asarray(as_numpy(positions)).dtype
    if kind.kind not in "fiu":
        raise ParameterError("positions.dtype", str(kind), expected="real numbers")
    return replace(loop, displacement=positions - loop.loop)


def with_correction(
    base: Placement, rows: Int[np.ndarray, " N"], correction: Correction
) -> Placement:
    """Add a correction to Loop's placement at some of its vertices."""
    count = base.loop.shape[0]
    return Placement(
        loop=base.loop,
        displacement=scatter(correction.displacement, rows, count),
        ratio=scatter(proximity_ratio(correction), rows, count),
        gate=scatter(correction.gate, rows, count),
        degenerate=scatter(correction.degenerate, rows, count),
        envelope=scatter(correction.envelope, rows, count),
    )


def with_more(base: Placement, rows: Int[np.ndarray, " N"], more: Correction) -> Placement:
    """Add a correction at rows where a placement added nothing yet."""
    count, displacement, bound = base.loop.shape[0], base.displacement, base.envelope
    assert displacement is not None  # a rule has placed them
    assert bound is not None
    return replace(
        base,
        displacement=displacement + scatter(more.displacement, rows, count),
        ratio=base.ratio + scatter(proximity_ratio(more), rows, count),
        envelope=bound + scatter(more.envelope, rows, count),
    )


def correct_in_blocks(
    blocks: Blocks, count: int, correct: Callable[[slice], Correction]
) -> Correction:
    """Make the correction of ``count`` rows block by block."""
    names = [field.name for field in fields(Correction)]

    def columns(rows: slice) -> tuple[Array, ...]:
        made = correct(rows)
        return tuple(getattr(made, name) for name in names)

    return Correction(*blocks.gather(count, columns))
