"""Skins and morph targets: attributes that follow vertices by the masks of the base scheme.

The learned correction is that of the base pose. So a refined mesh depends linearly on its morph
weights, and is the base pose where they are 0. Joints are names and are never averaged: the weights
of each joint are refined as a column, and each refined vertex keeps its heaviest joints.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.carry.columns import ColumnRefinement
from pns_common.carry.weights import keep_heaviest, scale_rows, whole_units
from pns_common.mesh.rows import as_words, distinct_rows
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes import LOOP, BaseScheme

from ...course import Course
from ...meshes.weld import canonical_zero
from ...options import Options
from ..read.accessors import as_float
from ..read.primitives import TrianglePrimitive

if TYPE_CHECKING:
    from pns_common.adaptive.refine import AdaptiveRefinement

    from .control_mesh import ControlMesh, Parts

POSITION = "POSITION"
SLOTS = 4
# Joints that are refined at a time: memory does not grow with the skeleton.
COLUMNS = 3
# Sums of weights that are multiples of 2⁻²⁴ are exact in float32, in any order.
FLOAT_UNITS = 2**24
# A loss of weight below this is rounding.
NOTHING = 1e-9

_SET = re.compile(r"WEIGHTS_([0-9]+)")
_NO_JOINT = np.iinfo(np.int64).max
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
        lost: share of the weight that each vertex lost for lack of slots; None: nothing.
    """

    binding: Binding | None
    deltas: tuple[Float[np.ndarray, "N 3"], ...]
    lost: Float[np.ndarray, " N"] | None = None

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


def refined_skin_and_morph(
    control: ControlMesh,
    refined_faces: Int[np.ndarray, "G 3"],
    topologies: Sequence[Topology],
    options: Options,
    course: Course,
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
        after = _refined(before, linear, slots, course)
        return after, *_losses(after.lost, None, 1)
    part = parts.of_row[rows]
    table = None
    if before.binding is not None:
        table, binding = _local_joints(before.binding, part, parts.count)
        before = replace(before, binding=binding)
    after = _refined(before, linear, slots, course)
    part_after = np.empty(linear.count, dtype=np.int64)
    # Descendants are ordered like their faces.
    of_face = np.repeat(part[mesh.faces[:, 0]], len(refined_faces) // len(mesh.faces))
    part_after[refined_faces] = of_face[:, None]
    if table is not None and after.binding is not None:
        after = replace(after, binding=table.named(after.binding, part_after))
    return after, *_losses(after.lost, part_after, parts.count)


def carried_skin_and_morph(
    control: ControlMesh, made: AdaptiveRefinement, course: Course
) -> tuple[SkinAndMorph, Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Refine skin and morph with faces of several levels; as ``refined_skin_and_morph``."""
    if not control.skin_and_morph.any:
        return control.skin_and_morph, np.zeros(1, dtype=np.int64), np.zeros(1)
    before = control.skin_and_morph.take(control.vertex_rows())
    slots = _common_slots(control, made.mesh.faces, made.trail.count, made.face_parents)
    after = _refined(before, made.trail, slots, course)
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
    course: Course,
) -> SkinAndMorph:
    """Refine skin and morph; deltas in float32, in which they are written."""
    binding, lost = None, None
    if before.binding is not None:
        binding, lost = _refined_binding(before.binding, linear, slots, course)
    deltas: list[Float[np.ndarray, "V 3"]] = []
    for delta in before.deltas:
        course.reach(1.0)
        deltas.append(linear(delta.astype(np.float64)).astype(np.float32))
    return SkinAndMorph(binding, tuple(deltas), lost)


def _refined_binding(
    binding: Binding, linear: Linear, slots: Int[np.ndarray, " V"] | None, course: Course
) -> tuple[Binding, Float[np.ndarray, " V"]]:
    """Refine a binding; return also the share of its weight that each vertex lost.

    `slots` are those of each refined vertex; None: all have the binding's. The course is reported
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
    return Binding(joints, weights), lost


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
