"""Skins and morph targets: attributes that follow vertices by the masks of the base scheme.

The learned correction is that of the base pose. So a refined mesh depends linearly on its morph
weights, and is the base pose where they are 0. Joints are names and are never averaged: the weights
of each joint are refined as a column, and each refined vertex keeps its heaviest joints.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from pns_common.carry.weights import keep_heaviest, scale_rows
from pns_common.parallel import Blocks, available_threads

from ...stages import Stages
from .control_mesh import ControlMesh
from .skin import SLOTS, Binding, SkinAndMorph, skin_sets
from .split import Split

# Joints that are refined at a time: memory does not grow with the skeleton.
COLUMNS = 3
# A loss of weight below this is rounding.
NOTHING = 1e-9


class Linear(Protocol):
    """A linear map of columns of vertices to those of ``count`` refined ones."""

    @property
    def count(self) -> int:
        """Number of refined vertices."""
        ...

    def __call__(self, columns: Float[np.ndarray, "V K"], /) -> Float[np.ndarray, "W K"]:
        """Refine columns."""
        ...


def refined_skin_and_morph(
    control: ControlMesh, split: Split, linear: Linear, stages: Stages
) -> SkinAndMorph:
    """Refine skin and morph with the vertices."""
    if not control.skin_and_morph.any:
        return control.skin_and_morph
    before = control.skin_and_morph.take(control.vertex_rows())
    return follow(before, linear, stages, _common_slots(control, split, linear.count))


def follow(
    before: SkinAndMorph,
    linear: Linear,
    stages: Stages,
    slots: Int[np.ndarray, " V"] | None = None,
) -> SkinAndMorph:
    """Refine skin and morph of vertices; deltas in float32, in which they are written.

    `slots` are those of each refined vertex; None: all have the binding's.
    """
    binding, lost = None, np.zeros(0)
    if before.binding is not None:
        binding, lost = _refined_binding(before.binding, linear, slots, stages)
        lost = lost[lost > NOTHING]
    deltas: list[Float[np.ndarray, "V 3"]] = []
    for delta in before.deltas:
        stages.reach(1.0)
        deltas.append(linear(delta.astype(np.float64)).astype(np.float32))
    return SkinAndMorph(binding, tuple(deltas), [(len(lost), float(lost.max(initial=0.0)))])


def _refined_binding(
    binding: Binding, linear: Linear, slots: Int[np.ndarray, " V"] | None, stages: Stages
) -> tuple[Binding, Float[np.ndarray, " V"]]:
    """Refine a binding; return also the share of its weight that each vertex lost.

    `slots` are those of each refined vertex; None: all have the binding's. The stages is reported
    between blocks of joints, of which a small file may have tens of thousands.
    """
    width, blocks = binding.weights.shape[1], Blocks(available_threads())
    bound = binding.weights > 0
    used, column = np.unique(binding.joints[bound], return_inverse=True)
    row, value = np.nonzero(bound)[0], binding.weights[bound]
    order = np.argsort(column, kind="stable")
    starts = np.searchsorted(column[order], np.arange(len(used) + COLUMNS))
    joints = np.zeros((linear.count, width), dtype=np.int32)
    weights, lost = np.zeros((linear.count, width)), np.zeros(linear.count)
    for first in range(0, len(used), COLUMNS):
        stages.reach(1.0)
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
    return Binding(joints, weights), lost


def _common_slots(control: ControlMesh, split: Split, count: int) -> Int[np.ndarray, " V"] | None:
    """Return the number of joints that each refined vertex may keep; None if all have equal room.

    A vertex of several primitives has the room of the narrowest. Otherwise the common edge would
    open in a pose.
    """
    slots = [SLOTS * len(skin_sets(primitive)) for primitive in control.primitives]
    if min(slots) == max(slots):
        return None
    at_vertices = np.full(count, max(slots))
    for room, share in zip(slots, control.shares, strict=True):
        np.minimum.at(at_vertices, split.part(share).vertices, room)
    return at_vertices
