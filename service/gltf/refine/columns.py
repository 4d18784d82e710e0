"""Skins and morph targets: attributes that follow vertices by the masks of the base scheme.

The learned correction is that of the base pose. So a refined mesh depends linearly on its morph
weights, and is the base pose where they are 0. Joints are names and are never averaged: the weights
of each joint are refined as a column, and each refined vertex keeps its heaviest joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Float, Int

from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry.columns import ColumnRefinement
from pns_common.carry.weights import keep_heaviest, scale_rows
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import LOOP, BaseScheme

from ...options import Options
from ...stages import Stages
from .control_mesh import ControlMesh, Parts
from .skin import SLOTS, Binding, SkinAndMorph, skin_sets

# Joints that are refined at a time: memory does not grow with the skeleton.
COLUMNS = 3
# A loss of weight below this is rounding.
NOTHING = 1e-9
# Joints have at most two bytes.
_JOINTS = 2**16


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
    control: ControlMesh,
    refined_faces: Int[np.ndarray, "G 3"],
    topologies: Sequence[Topology],
    options: Options,
    stages: Stages,
    parts: Parts | None = None,
    base: BaseScheme = LOOP,
) -> tuple[SkinAndMorph, Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Refine skin and morph; return also how many vertices of each part lost a joint.

    The last of the three is the largest share of its weight that one of them lost.
    `topologies` are those of the meshes that were refined, level by level, by a base scheme.
    """
    if not control.skin_and_morph.any:
        return control.skin_and_morph, np.zeros(1, dtype=np.int64), np.zeros(1)
    mesh, rows = control.mesh, control.vertex_rows()
    before = control.skin_and_morph.take(rows)
    linear = ColumnRefinement(topologies, base, options.limit, Blocks(available_threads()))
    slots = _common_slots(control, refined_faces, linear.count)
    if parts is None:
        after = _refined(before, linear, slots, stages)
        return after, *_losses(after.lost, None, 1)
    part = parts.of_row[rows]
    table = None
    if before.binding is not None:
        table, binding = _local_joints(before.binding, part, parts.count)
        before = replace(before, binding=binding)
    after = _refined(before, linear, slots, stages)
    part_after = np.empty(linear.count, dtype=np.int64)
    # Descendants are ordered like their faces.
    of_face = np.repeat(part[mesh.faces[:, 0]], len(refined_faces) // len(mesh.faces))
    part_after[refined_faces] = of_face[:, None]
    if table is not None and after.binding is not None:
        after = replace(after, binding=table.named(after.binding, part_after))
    return after, *_losses(after.lost, part_after, parts.count)


def carried_skin_and_morph(
    control: ControlMesh, made: AdaptiveRefinement, stages: Stages
) -> tuple[SkinAndMorph, Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Refine skin and morph with faces of several levels; as ``refined_skin_and_morph``."""
    if not control.skin_and_morph.any:
        return control.skin_and_morph, np.zeros(1, dtype=np.int64), np.zeros(1)
    before = control.skin_and_morph.take(control.vertex_rows())
    slots = _common_slots(control, made.mesh.faces, made.trail.count, made.face_parents)
    after = _refined(before, made.trail, slots, stages)
    return after, *_losses(after.lost, None, 1)


def _losses(
    lost: Float[np.ndarray, " V"] | None, part: Int[np.ndarray, " V"] | None, count: int
) -> tuple[Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Return how many vertices of each part lost weight, and the most that one of them lost."""
    largest = np.zeros(count)
    if lost is None:
        return np.zeros(count, dtype=np.int64), largest
    rows = np.flatnonzero(lost > NOTHING)
    whose = np.zeros(len(rows), dtype=np.int64) if part is None else part[rows]
    np.maximum.at(largest, whose, lost[rows])
    return np.bincount(whose, minlength=count), largest


def _refined(
    before: SkinAndMorph,
    linear: Linear,
    slots: Int[np.ndarray, " V"] | None,
    stages: Stages,
) -> SkinAndMorph:
    """Refine skin and morph; deltas in float32, in which they are written."""
    binding, lost = None, None
    if before.binding is not None:
        binding, lost = _refined_binding(before.binding, linear, slots, stages)
    deltas: list[Float[np.ndarray, "V 3"]] = []
    for delta in before.deltas:
        stages.reach(1.0)
        deltas.append(linear(delta.astype(np.float64)).astype(np.float32))
    return SkinAndMorph(binding, tuple(deltas), lost)


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


def _common_slots(
    control: ControlMesh,
    refined_faces: Int[np.ndarray, "G 3"],
    count: int,
    parents: Int[np.ndarray, " G"] | None = None,
) -> Int[np.ndarray, " V"] | None:
    """Return the number of joints that each refined vertex may keep; None if all have equal room.

    A vertex of several primitives has the room of the narrowest. Otherwise the common edge would
    open in a pose.
    """
    slots = [SLOTS * len(skin_sets(primitive)) for primitive in control.primitives]
    if min(slots) == max(slots):
        return None
    of_kept = np.repeat(slots, control.kept_counts)
    of_face = np.full(control.surface.face_count, max(slots))
    # Copies of a face share its refined vertices.
    np.minimum.at(of_face, control.face_of_kept, of_kept)
    at_vertices = np.full(count, max(slots))
    # Descendants are ordered like their faces, of polygons like their corners.
    if control.polygons is not None:
        of_face = np.repeat(of_face, np.diff(control.surface.offsets))
    if parents is None:
        parents = np.repeat(np.arange(len(of_face)), len(refined_faces) // len(of_face))
    children = of_face[parents]
    np.minimum.at(at_vertices, refined_faces, children[:, None])
    return at_vertices


@dataclass(frozen=True, eq=False)
class _LocalJoints:
    """The joints with weight in each of P parts, numbered from 0 in each.

    Joints are refined in blocks of columns. Numbered as in the file there would be as many columns
    as all parts have joints; numbered in each part there are as many as the largest has.

    Attributes:
        joints: ascending in each part, part after part.
        first: (P,) where the joints of each part begin.
    """

    joints: Int[np.ndarray, " J"]
    first: Int[np.ndarray, " P"]

    def named(self, binding: Binding, part: Int[np.ndarray, " N"]) -> Binding:
        """Return a binding of vertices in some parts with the file's joints."""
        bound = binding.weights > 0
        place = np.where(bound, self.first[part][:, None] + binding.joints, 0)
        return Binding(np.where(bound, np.append(self.joints, 0)[place], 0), binding.weights)


def _local_joints(
    binding: Binding, part: Int[np.ndarray, " N"], count: int
) -> tuple[_LocalJoints, Binding]:
    """Return the joints of `count` parts, and the binding of their vertices to these."""
    bound = binding.weights > 0
    codes = part[:, None] * _JOINTS + binding.joints
    used = np.unique(codes[bound])
    first = np.searchsorted(used, np.arange(count) * _JOINTS)
    place = np.where(bound, np.searchsorted(used, codes) - first[part][:, None], 0)
    return _LocalJoints(used % _JOINTS, first), Binding(place, binding.weights)
