"""Skins and morph targets as a file has them: read into columns of vertices, and written again."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.weights import scale_rows, whole_units
from pns_common.mesh.rows import as_words, distinct_rows
from pns_common.parallel import Blocks, available_threads

from ...meshes.weld import canonical_zero
from ..read.accessors import as_float
from ..read.primitives import TrianglePrimitive

POSITION = "POSITION"
SLOTS = 4
# Sums of weights that are multiples of 2⁻²⁴ are exact in float32, in any order.
FLOAT_UNITS = 2**24

_SET = re.compile(r"WEIGHTS_([0-9]+)")
_NO_JOINT = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Binding:
    """The joints of N vertices (glTF 2.0 §3.7.3.3), heaviest first.

    Attributes:
        joints: (N, K) distinct joints of each vertex; 0 where the weight is 0.
        weights: (N, K) weights, of sum 1, or 0 for a vertex without joints.
    """

    joints: Int[np.ndarray, "N K"]
    weights: Float[np.ndarray, "N K"]

    def take(self, rows: Int[np.ndarray, " M"]) -> Binding:
        """Return the binding of some of the vertices."""
        return Binding(*(np.take(part, rows, axis=0) for part in (self.joints, self.weights)))


@dataclass(frozen=True, eq=False)
class SkinAndMorph:
    """Skin binding and morph deltas of N vertices.

    Attributes:
        binding: None for a mesh without skin.
        deltas: for each morph target, the displacement of each vertex.
        losses: for each part, the number of vertices that lost weight for lack of slots, and the
            most that one of them lost.
    """

    binding: Binding | None
    deltas: tuple[Float[np.ndarray, "N 3"], ...]
    losses: Sequence[tuple[int, float]] = ((0, 0.0),)

    @property
    def any(self) -> bool:
        """True where there is a skin or a morph target."""
        return self.binding is not None or bool(self.deltas)

    @property
    def labels(self) -> Int[np.ndarray, " N"] | None:
        """Labels that vertices share if no pose moves them apart; None without skin and morph."""
        words = [as_words(canonical_zero(delta)) for delta in self.deltas]
        if self.binding is not None:
            words += [as_words(self.binding.joints)]
            words += [as_words(self.binding.weights.astype(np.float32))]
        return distinct_rows(np.hstack(words)) if words else None

    def take(self, rows: Int[np.ndarray, " M"]) -> SkinAndMorph:
        """Return skin and morph of some of the vertices."""
        binding = None if self.binding is None else self.binding.take(rows)
        return SkinAndMorph(binding, tuple(np.take(d, rows, axis=0) for d in self.deltas))

    @classmethod
    def joined(cls, parts: Sequence[SkinAndMorph]) -> SkinAndMorph:
        """Return skin and morph of the vertices of all parts, which are bound alike."""
        pairs = [(p.binding.joints, p.binding.weights) for p in parts if p.binding is not None]
        binding = Binding(*map(np.concatenate, zip(*pairs, strict=True))) if pairs else None
        deltas = zip(*(part.deltas for part in parts), strict=True)
        losses = list(chain.from_iterable(part.losses for part in parts))
        return cls(binding, tuple(map(np.concatenate, deltas)), losses)


def skin_sets(primitive: TrianglePrimitive) -> list[int]:
    """Return the numbers n of the attributes WEIGHTS_n, ascending; each has its JOINTS_n."""
    matches = (_SET.fullmatch(name) for name in primitive.attributes)
    return sorted(int(match[1]) for match in matches if match)


def read_skin_and_morph(primitives: Sequence[TrianglePrimitive]) -> SkinAndMorph:
    """Read skin and morph of a mesh's rows, primitive after primitive."""
    count = max(len(primitive.targets) for primitive in primitives)
    deltas = [np.concatenate([_delta(p, target) for p in primitives]) for target in range(count)]
    return SkinAndMorph(read_binding(primitives), tuple(deltas))


def _delta(primitive: TrianglePrimitive, target: int) -> Float[np.ndarray, "N 3"]:
    """Return the position deltas of a target; zeros if the primitive or the target has none."""
    if target < len(primitive.targets) and POSITION in primitive.targets[target]:
        return primitive.targets[target][POSITION]
    return np.zeros((len(primitive.attributes[POSITION]), 3), dtype=np.float32)


def read_binding(primitives: Sequence[TrianglePrimitive]) -> Binding | None:
    """Read the binding of a mesh's rows, primitive after primitive; None without skin."""
    width = SLOTS * max(len(skin_sets(primitive)) for primitive in primitives)
    if width == 0:
        return None
    joints, weights = [], []
    for primitive in primitives:
        rows, own = len(primitive.attributes[POSITION]), skin_sets(primitive)
        padding = np.zeros((rows, width - SLOTS * len(own)))
        names = [primitive.attributes[f"JOINTS_{n}"].astype(np.int64) for n in own]
        parts = [_fractions(primitive.attributes[f"WEIGHTS_{n}"]) for n in own]
        joints.append(np.hstack([*names, padding.astype(np.int64)]))
        weights.append(np.hstack([*parts, padding]))
    binding = Binding(*_distinct_joints(np.concatenate(joints), np.concatenate(weights)))
    scale_rows(binding.weights, Blocks(available_threads()))
    return binding


def _fractions(weights: Shaped[np.ndarray, "N 4"]) -> Float[np.ndarray, "N 4"]:
    exact = weights if weights.dtype.kind == "f" else as_float(weights, normalized=True)
    return exact.astype(np.float64)


def _distinct_joints(
    joints: Int[np.ndarray, "N K"], weights: Float[np.ndarray, "N K"]
) -> tuple[Int[np.ndarray, "N K"], Float[np.ndarray, "N K"]]:
    """Return the joints of each row, heaviest first; weights of a repeated joint add up."""
    joints = np.where(weights > 0, joints, _NO_JOINT)
    order = np.argsort(joints, axis=1, kind="stable")
    joints, weights = (np.take_along_axis(part, order, axis=1) for part in (joints, weights))
    # A loop over slots, of which there are four a set.
    for slot in range(1, joints.shape[1]):
        again = joints[:, slot] == joints[:, slot - 1]
        weights[again, slot] += weights[again, slot - 1]
        weights[again, slot - 1] = 0
    order = np.argsort(-weights, axis=1, kind="stable")
    joints, weights = (
        np.ascontiguousarray(np.take_along_axis(part, order, axis=1)) for part in (joints, weights)
    )
    return np.where(weights > 0, joints, 0), weights


def skin_attributes(
    primitive: TrianglePrimitive, binding: Binding
) -> dict[str, Shaped[np.ndarray, "N 4"]]:
    """Return JOINTS_n and WEIGHTS_n of refined vertices in the primitive's sets and types."""
    sets = skin_sets(primitive)
    attributes: dict[str, Shaped[np.ndarray, "N 4"]] = {}
    if not sets:
        return attributes
    width = SLOTS * len(sets)
    dtype = primitive.attributes[f"WEIGHTS_{sets[0]}"].dtype
    total_units = FLOAT_UNITS if dtype.kind == "f" else int(np.iinfo(dtype).max)
    units = whole_units(binding.weights[:, :width], total_units, Blocks(available_threads()))
    joints = np.where(units > 0, binding.joints[:, :width], 0)
    # Joints of another primitive may reach across a common edge.
    wide = np.uint16 if joints.max(initial=0) > np.iinfo(np.uint8).max else np.uint8
    for place, number in enumerate(sets):
        own = slice(SLOTS * place, SLOTS * (place + 1))
        old = primitive.attributes[f"JOINTS_{number}"].dtype
        attributes[f"JOINTS_{number}"] = joints[:, own].astype(np.promote_types(old, wide))
        shares = units[:, own] / total_units if dtype.kind == "f" else units[:, own]
        attributes[f"WEIGHTS_{number}"] = shares.astype(dtype)
    return attributes
