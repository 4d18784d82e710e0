"""What follows the vertices of a mesh wherever the stencils take them: skin bindings, morph deltas.

Both go through Loop's masks alone. The learned correction stays what it was in the base pose, so a
refined mesh depends on its morph weights linearly, and is the base pose where they are 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.distinct import as_words, distinct_rows
from pns_common.masks.linear import ColumnRefinement

from ...course import Course
from ...meshes.weld import canonical_zero
from ..read.primitives import TrianglePrimitive
from .skins import Binding, read_binding, refine_binding

POSITION = "POSITION"
_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SkinAndMorph:
    """What follows N vertices.

    Attributes:
        binding: their joints; None for a mesh without skin.
        deltas: for each morph target how far it moves them.
        cut: which of them have lost a joint for want of slots.
    """

    binding: Binding | None
    deltas: tuple[Float[np.ndarray, "N 3"], ...]
    cut: Int[np.ndarray, " n"]

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self.binding is not None or bool(self.deltas)

    @property
    def labels(self) -> Int[np.ndarray, " N"] | None:
        """Numbers that vertices share where nothing can move them apart; None without any."""
        words = [as_words(canonical_zero(delta)) for delta in self.deltas]
        if self.binding is not None:
            words += [as_words(self.binding.joints)]
            words += [as_words(self.binding.weights.astype(np.float32))]
        return distinct_rows(np.hstack(words)) if words else None

    def take(self, rows: Int[np.ndarray, " M"]) -> SkinAndMorph:
        """Return skin and morph of some of the vertices."""
        binding = None if self.binding is None else self.binding.take(rows)
        deltas = tuple(np.take(delta, rows, axis=0) for delta in self.deltas)
        return SkinAndMorph(binding, deltas, _NONE)


def read_skin_and_morph(primitives: Sequence[TrianglePrimitive]) -> SkinAndMorph:
    """Read skin and morph of all vertices of a mesh, one primitive after the other."""
    count = max(len(primitive.targets) for primitive in primitives)
    deltas = [np.concatenate([_delta(p, target) for p in primitives]) for target in range(count)]
    return SkinAndMorph(read_binding(primitives), tuple(deltas), _NONE)


def refine_skin_and_morph(
    control: SkinAndMorph,
    linear: ColumnRefinement,
    slots: Int[np.ndarray, " V"] | None,
    course: Course,
) -> SkinAndMorph:
    """Refine skin and morph; deltas in float32, as they will be written; `slots` as for skins."""
    binding, cut = None, _NONE
    if control.binding is not None:
        binding, cut = refine_binding(control.binding, linear, slots, course)
    deltas: list[Float[np.ndarray, "V 3"]] = []
    for delta in control.deltas:
        course.reach(1.0)
        deltas.append(linear(delta.astype(np.float64)).astype(np.float32))
    return SkinAndMorph(binding, tuple(deltas), cut)


def _delta(primitive: TrianglePrimitive, target: int) -> Float[np.ndarray, "N 3"]:
    """Read a target's position deltas; zeros where the primitive or the target has none."""
    if target < len(primitive.targets) and POSITION in primitive.targets[target]:
        return primitive.targets[target][POSITION]
    return np.zeros((len(primitive.attributes[POSITION]), 3), dtype=np.float32)
