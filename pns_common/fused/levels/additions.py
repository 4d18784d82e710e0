"""What a learned level adds to Loop's vertices."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.additions import clear_rows
from pns_common.fused.kernels.compiled import ROWS


@dataclass(frozen=True, eq=False)
class Additions:
    """What is added to N of Loop's vertices, as ``placement.Added`` has it.

    ``displacement`` and ``envelope`` have no rows once they are forgotten.
    """

    displacement: Float[np.ndarray, "M 3"]
    ratio: Float[np.ndarray, " N"]
    gate: Float[np.ndarray, " N"]
    envelope: Float[np.ndarray, " M"]
    degenerate: Bool[np.ndarray, " N"]
    corrected: Bool[np.ndarray, " N"] | None = None

    @classmethod
    def unwritten(cls, count: int) -> Additions:
        """Make room for numbers that are to be written, or cleared, in every row."""
        ratio, gate, envelope = (np.empty(count) for _ in range(3))
        return cls(np.empty((count, 3)), ratio, gate, envelope, np.zeros(count, dtype=bool))

    def rows(self, rows: slice | Int[np.ndarray, " N"]) -> Additions:
        """Return some of the rows: views for a slice, copies for indices."""
        return Additions(
            self.displacement[rows],
            self.ratio[rows],
            self.gate[rows],
            self.envelope[rows],
            self.degenerate[rows],
            None if self.corrected is None else self.corrected[rows],
        )

    def forgotten(self) -> Additions:
        """Return the same without δ and ρ, two thirds of what it takes."""
        none = slice(0, 0)
        displacement, envelope = self.displacement[none].copy(), self.envelope[none].copy()
        return replace(self, displacement=displacement, envelope=envelope)

    def clear(self) -> None:
        """Add nothing to any row."""
        for values in (self.displacement, self.ratio, self.gate, self.envelope):
            values[:] = 0

    def clear_rows(self, rows: Int[np.ndarray, " N"], blocks: Blocks) -> None:
        """Add nothing to some of the rows, int32."""
        values = self.displacement, self.ratio, self.gate, self.envelope
        blocks.unheard().run(len(rows), clear_rows.over(rows, ROWS, *values))

    def scale(self, by: Float[np.ndarray, " N"]) -> None:
        """Take s δ in place of δ."""
        self.displacement[:] *= by[:, None]
        self.ratio[:] *= by
