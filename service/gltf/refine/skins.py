"""Skin bindings: which joints move a vertex, and by how much (glTF 2.0 §3.7.3.3).

Joints are names, so they are never averaged: each joint's weights go through the stencil that moves
the vertices, as one column, and the heaviest joints of each refined vertex are kept.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.blocks import available_threads
from pns_common.fused import kernel_blocks
from pns_common.fused.where_loaded.shares import keep_heaviest, scale_rows, whole_units
from pns_common.masks.linear import ColumnRefinement

from ...course import Course
from ..read.primitives import TrianglePrimitive
from ..read.quantization import as_float

SLOTS = 4
# Joints refined at a time, as many as a point has coordinates: the memory does not grow with the
# skeleton.
COLUMNS = 3
# Integers up to here are exact in float32, and so are their sums: weights that are multiples of
# 2⁻²⁴ add up to exactly 1 in any order.
FLOAT_UNITS = 2**24
# A cut that takes less than this from a vertex is rounding.
NOTHING = 1e-9

_SET = re.compile(r"WEIGHTS_([0-9]+)")
_NO_JOINT = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Binding:
    """The joints of N vertices, heaviest first.

    Attributes:
        joints: (N, K) distinct joints of each vertex; 0 where the weight is 0.
        weights: (N, K) their weights, which sum to 1, or to 0 where a vertex has no joint.
    """

    joints: Int[np.ndarray, "N K"]
    weights: Float[np.ndarray, "N K"]

    def take(self, rows: Int[np.ndarray, " M"]) -> Binding:
        """Return the binding of some of the vertices."""
        return Binding(*(np.take(part, rows, axis=0) for part in (self.joints, self.weights)))


def skin_sets(primitive: TrianglePrimitive) -> list[int]:
    """Return the numbers n of its attributes WEIGHTS_n, ascending; each has its JOINTS_n."""
    matches = (_SET.fullmatch(name) for name in primitive.attributes)
    return sorted(int(match[1]) for match in matches if match)


def read_binding(primitives: Sequence[TrianglePrimitive]) -> Binding | None:
    """Read the binding of a mesh's vertices, one primitive after the other; None without any."""
    width = SLOTS * max(len(skin_sets(primitive)) for primitive in primitives)
    if width == 0:
        return None
    joints, weights = [], []
    for primitive in primitives:
        rows, own = len(primitive.attributes["POSITION"]), skin_sets(primitive)
        padding = np.zeros((rows, width - SLOTS * len(own)))
        names = [primitive.attributes[f"JOINTS_{n}"].astype(np.int64) for n in own]
        parts = [_fractions(primitive.attributes[f"WEIGHTS_{n}"]) for n in own]
        joints.append(np.hstack([*names, padding.astype(np.int64)]))
        weights.append(np.hstack([*parts, padding]))
    binding = Binding(*_distinct_joints(np.concatenate(joints), np.concatenate(weights)))
    scale_rows(binding.weights, kernel_blocks(available_threads()))
    return binding


def refine_binding(
    binding: Binding, linear: ColumnRefinement, slots: Int[np.ndarray, " V"] | None, course: Course
) -> tuple[Binding, Int[np.ndarray, " V"]]:
    """Refine the binding; return also which vertices lost a joint for want of slots.

    `slots` are those of each refined vertex; None: all have the binding's. `course` may end it
    between two blocks of joints, of which a small file may have tens of thousands.
    """
    width, blocks = binding.weights.shape[1], kernel_blocks(available_threads())
    bound = binding.weights > 0
    used, column = np.unique(binding.joints[bound], return_inverse=True)
    row, value = np.nonzero(bound)[0], binding.weights[bound]
    order = np.argsort(column, kind="stable")
    starts = np.searchsorted(column[order], np.arange(len(used) + COLUMNS))
    joints = np.zeros((linear.count, width), dtype=np.int32)
    weights, lost = np.zeros((linear.count, width)), np.zeros(linear.count)
    for first in range(0, len(used), COLUMNS):
        course.reach(1.0)
        names = used[first : first + COLUMNS]
        here = order[starts[first] : starts[first + len(names)]]
        dense = np.zeros((len(bound), len(names)))
        dense[row[here], column[here] - first] = value[here]
        keep_heaviest(linear(dense), names, joints, weights, lost, blocks)
    if slots is not None:
        beyond = np.arange(width) >= slots[:, None]
        lost += np.where(beyond, weights, 0).sum(axis=1)
        joints[beyond], weights[beyond] = 0, 0
    scale_rows(weights, blocks)
    return Binding(joints, weights), np.flatnonzero(lost > NOTHING)


def skin_attributes(
    primitive: TrianglePrimitive, binding: Binding
) -> dict[str, Shaped[np.ndarray, "N 4"]]:
    """Return JOINTS_n and WEIGHTS_n of refined vertices, sets and types as there were."""
    sets = skin_sets(primitive)
    kept = Binding(*(part[:, : SLOTS * len(sets)] for part in (binding.joints, binding.weights)))
    attributes: dict[str, Shaped[np.ndarray, "N 4"]] = {}
    if not sets:
        return attributes
    dtype = primitive.attributes[f"WEIGHTS_{sets[0]}"].dtype
    total_units = FLOAT_UNITS if dtype.kind == "f" else int(np.iinfo(dtype).max)
    units = whole_units(kept.weights, total_units, kernel_blocks(available_threads()))
    joints = np.where(units > 0, kept.joints, 0)
    # Another primitive's joints may reach across their common edge.
    wide = np.uint16 if joints.max(initial=0) > np.iinfo(np.uint8).max else np.uint8
    for place, number in enumerate(sets):
        slots = slice(SLOTS * place, SLOTS * (place + 1))
        old = primitive.attributes[f"JOINTS_{number}"].dtype
        attributes[f"JOINTS_{number}"] = joints[:, slots].astype(np.promote_types(old, wide))
        shares = units[:, slots] / total_units if dtype.kind == "f" else units[:, slots]
        attributes[f"WEIGHTS_{number}"] = shares.astype(dtype)
    return attributes


def _fractions(weights: Shaped[np.ndarray, "N 4"]) -> Float[np.ndarray, "N 4"]:
    exact = weights if weights.dtype.kind == "f" else as_float(weights, normalized=True)
    return exact.astype(np.float64)


def _distinct_joints(
    joints: Int[np.ndarray, "N K"], weights: Float[np.ndarray, "N K"]
) -> tuple[Int[np.ndarray, "N K"], Float[np.ndarray, "N K"]]:
    """Return each row's joints, heaviest first; the weights of one that is named twice add up."""
    joints = np.where(weights > 0, joints, _NO_JOINT)
    order = np.argsort(joints, axis=1, kind="stable")
    joints, weights = (np.take_along_axis(part, order, axis=1) for part in (joints, weights))
    # A loop over slots, of which there are four a set.
    for slot in range(1, joints.shape[1]):
        again = joints[:, slot] == joints[:, slot - 1]
        weights[again, slot] += weights[again, slot - 1]
        weights[again, slot - 1] = 0
    order = np.argsort(-weights, axis=1, kind="stable")
    joints, weights = (np.take_along_axis(part, order, axis=1) for part in (joints, weights))
    return np.where(weights > 0, joints, 0), weights
