"""Refine small meshes of one kind together, so that the fixed cost of each step is paid once.

Scenes from CAD and building models have thousands of meshes of a few faces. Primitive s of their
union holds the rows and faces of primitive s of each mesh, in the order of the meshes. Each mesh
has the bits that it would have alone: positions are joined inside of a part only, and nothing is
summed over parts.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from pns_common.errors import MeshError
from pns_common.mesh.creases import Creases
from pns_common.mesh.rows import disjoint_faces
from pns_common.operator.scheme import Scheme
from pns_common.report import Report
from pns_common.schemes.matrix import SubdivisionMatrix

from ...advice import NO_BENDS, Bends, count_bends
from ...changes import Change
from ...options import Options
from ...stages import Stages
from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .attributes import Columns, RefinedPrimitive, refined_primitives
from .changes import (
    changes_of_primitive,
    changes_of_vertices,
    near_miss_changes,
    near_misses,
    opposed_normals,
)
from .control_mesh import ControlMesh, Parts, control_mesh, slices
from .mesh_refine import (
    RefinedMesh,
    creases_of,
    refined_union,
    sharp_after,
)
from .new_normals import with_normal_accessor, with_normal_rule, with_smooth_normals
from .skin import skin_sets

NOTHING_LOST = 0, 0.0


@dataclass(frozen=True)
class StageShares:
    """Starts of the stages of a mesh, as shares of its work; writing is the rest."""

    weld: float
    refine: float
    attributes: float
    write: float


@dataclass(frozen=True, eq=False)
class MeshOutcome:
    """A refined mesh.

    Attributes:
        index: its place in `meshes`.
        primitives: its triangle primitives.
        kept: for each primitive, which faces have three different welded vertices.
        refined: the primitives that have a face left.
        copies: number of faces with the vertices of an earlier face.
        report: the operator's; None if no face was left.
        changes: what was joined, dropped or cut.
        bends: steep edges, and those in doubt.
        parents: what each refined vertex is made of, if asked for: rows of the primitives, one
            primitive after the other.
    """

    index: int
    primitives: Sequence[TrianglePrimitive]
    kept: Sequence[Bool[np.ndarray, " F"]]
    refined: Sequence[RefinedPrimitive]
    copies: int
    report: Report | None
    changes: list[Change]
    bends: Bends = NO_BENDS
    parents: SubdivisionMatrix | None = None

    @property
    def degenerate(self) -> int:
        """Number of faces without three different vertices."""
        return sum(int((~keep).sum()) for keep in self.kept)

    def of(self, mesh: int) -> MeshOutcome:
        """Return the outcome of another mesh with this geometry."""
        before, after = (f"/meshes/{index}" for index in (self.index, mesh))
        moved = [
            replace(change, pointer=after + change.pointer.removeprefix(before))
            for change in self.changes
        ]
        return replace(self, index=mesh, changes=moved)


def outcome_of(
    index: int,
    primitives: Sequence[TrianglePrimitive],
    kept: Sequence[Bool[np.ndarray, " F"]],
    refined: Sequence[RefinedPrimitive],
    levels: int,
    near: int,
    misses: int,
    losses: tuple[int, float] = NOTHING_LOST,
    **others: Any,
) -> MeshOutcome:
    """Return the outcome of a mesh with its changes.

    `near` vertices were joined, and `misses` at borders nearly meet; `losses` are those of joints.
    """
    pointer = f"/meshes/{index}"
    changes = [
        change
        for primitive, keep in zip(primitives, kept, strict=True)
        for change in changes_of_primitive(primitive, keep, levels, pointer)
    ]
    changes += changes_of_vertices(near, *losses, pointer) + near_miss_changes(misses, pointer)
    changes += opposed_normals(refined, pointer)
    return MeshOutcome(index, primitives, kept, refined, changes=changes, **others)


def kind_of(primitives: Sequence[TrianglePrimitive]) -> Hashable | None:
    """Return what meshes that may be joined have in common; None for a mesh that may not.

    The edges of a union are not followed. Its vertices have equal room for joints, of one type:
    other types may become wider by the joints of another mesh.
    """
    joints = [[p.attributes[f"JOINTS_{n}"].dtype for n in skin_sets(p)] for p in primitives]
    one_room = len(set(map(len, joints))) == 1 and len({*chain(*joints)}) <= 1
    if not one_room or any(p.outline is not None for p in primitives):
        return None
    return tuple(
        tuple(map(_signature, (p.attributes, *p.targets), (p.accessors, *p.target_accessors)))
        for p in primitives
    )


def _signature(columns: Columns, accessors: dict[str, Accessor]) -> Hashable:
    return tuple(
        (name, values.dtype.str, values.shape[1], accessors[name].normalized)
        for name, values in columns.items()
    )


def refine_batch(
    meshes: Sequence[Sequence[TrianglePrimitive]],
    numbers: Sequence[int],
    scheme: Scheme,
    options: Options,
    stages: Stages,
    shares: StageShares,
) -> Sequence[MeshOutcome | None]:
    """Refine meshes of one kind, given by their primitives; `numbers` are their places in the file.

    None for a mesh that must be refined alone: it has no face left or no extent, or it cannot be
    refined, which is then reported.
    """
    primitives, parts = _joined(meshes)
    options = with_normal_rule(options, primitives)
    with stages.stage("weld", shares.weld, shares.refine):
        control = control_mesh(primitives, options, parts)
    able = _refinable(control, parts)
    if not able.any():
        return [None] * len(meshes)
    if not able.all():
        some, theirs = list(compress(meshes, able)), list(compress(numbers, able))
        made = iter(refine_batch(some, theirs, scheme, options, stages, shares))
        return [next(made) if each else None for each in able]
    with stages.stage("weld", shares.weld, shares.refine):
        creases = creases_of(control, options, scheme, parts)
        if options.normals != "keep":
            control, parts = _smoothed(control, parts, creases, options)
    with stages.stage("refine", shares.refine, shares.attributes):
        try:
            made = refined_union(control, parts, creases, scheme, options, stages)
        except MeshError:
            # The error does not say which mesh it is; that of a mesh alone does.
            return [None] * len(meshes)
    with stages.stage("attributes", shares.attributes, shares.write):
        pieces = refined_primitives(control, made, creases, options, stages)
        part_of_face = control.of_cleaned(parts.of_face[np.concatenate(control.kept)])
        bends = count_bends(control.mesh, creases, options, len(meshes), part_of_face)
        return _divided(control, parts, made, pieces, meshes, numbers, bends, options)


def _refinable(control: ControlMesh, parts: Parts) -> Bool[np.ndarray, " P"]:
    """Return which parts have a face left and an extent."""
    proper = np.concatenate(control.kept)
    points = control.weld.points[control.weld.faces]
    low, high = np.full((parts.count, 3), np.inf), np.full((parts.count, 3), -np.inf)
    np.minimum.at(low, parts.of_face[proper], points[proper].min(axis=1))
    np.maximum.at(high, parts.of_face[proper], points[proper].max(axis=1))
    extended: Bool[np.ndarray, " P"] = np.any(high > low, axis=1)
    return extended


def _smoothed(
    control: ControlMesh, parts: Parts, creases: Creases, options: Options
) -> tuple[ControlMesh, Parts]:
    """Return the union with new normals, which split vertices into more rows."""
    primitives = with_smooth_normals(control, sharp_after(creases, options.levels))
    of_row = np.concatenate(
        [
            parts.of_row[share][primitive.rows]
            for share, primitive in zip(control.rows, primitives, strict=True)
        ]
    )
    return control.with_new_normals(primitives), replace(parts, of_row=of_row)


def _joined(meshes: Sequence[Sequence[TrianglePrimitive]]) -> tuple[list[TrianglePrimitive], Parts]:
    """Return the primitives of the union, and the parts of their rows and faces."""
    numbers = np.arange(len(meshes))
    alike = list(zip(*meshes, strict=True))
    rows = [[len(p.attributes["POSITION"]) for p in own] for own in alike]
    faces = [[len(p.corners) for p in own] for own in alike]
    parts = Parts(
        of_row=np.concatenate([np.repeat(numbers, lengths) for lengths in rows]),
        of_face=np.concatenate([np.repeat(numbers, lengths) for lengths in faces]),
        count=len(meshes),
    )
    return [_joined_primitive(place, own) for place, own in enumerate(alike)], parts


def _joined_primitive(place: int, primitives: Sequence[TrianglePrimitive]) -> TrianglePrimitive:
    first = primitives[0]
    counts = [len(primitive.attributes["POSITION"]) for primitive in primitives]
    faces = [primitive.corners for primitive in primitives]
    return TrianglePrimitive(
        number=place,
        rows=np.arange(sum(counts)),
        corners=disjoint_faces(zip(faces, counts, strict=True)),
        attributes=_concatenated([primitive.attributes for primitive in primitives]),
        accessors=first.accessors,
        targets=tuple(map(_concatenated, zip(*(p.targets for p in primitives), strict=True))),
        target_accessors=first.target_accessors,
    )


def _concatenated(columns: Sequence[Columns]) -> Columns:
    return {name: np.concatenate([each[name] for each in columns]) for name in columns[0]}


def _divided(
    control: ControlMesh,
    parts: Parts,
    made: RefinedMesh,
    pieces: Sequence[RefinedPrimitive],
    meshes: Sequence[Sequence[TrianglePrimitive]],
    numbers: Sequence[int],
    bends: Sequence[Bends],
    options: Options,
) -> list[MeshOutcome]:
    """Cut the refined primitives of the union into those of its parts."""
    cleaned = control.cleaned
    copied = (cleaned.representative >= 0) & (cleaned.face_map < 0)
    copies, near = parts.count_faces(copied).tolist(), control.near.tolist()
    refined: list[list[RefinedPrimitive]] = [[] for _ in meshes]
    # A primitive without a face left in any part is not among the pieces.
    for piece in pieces:
        place = piece.source.number
        own = [primitives[place] for primitives in meshes]
        kept = _shares(control.kept[place], own)
        counts = np.array([int(keep.sum()) for keep in kept]) * 4**options.levels
        sources = own if options.normals == "keep" else [_with_normal_accessor(p) for p in own]
        for into, cut in zip(refined, _divided_primitive(piece, counts, sources), strict=True):
            if len(cut.faces):
                into.append(cut)
    kept = [
        _shares(keep, [primitives[place] for primitives in meshes])
        for place, keep in enumerate(control.kept)
    ]
    lengths = [report["reference_length"] for report in made.reports]
    of_vertex = parts.of_row[control.vertex_rows()]
    misses = near_misses(control.mesh.vertices, control.mesh.topology(), lengths, of_vertex)
    return [
        outcome_of(
            number,
            primitives,
            [keep[part] for keep in kept],
            refined[part],
            options.levels,
            near[part],
            misses[part],
            made.skin_and_morph.losses[part],
            copies=copies[part],
            report=made.reports[part],
            bends=bends[part],
        )
        for part, (number, primitives) in enumerate(zip(numbers, meshes, strict=True))
    ]


def _divided_primitive(
    refined: RefinedPrimitive, counts: Int[np.ndarray, " P"], sources: Sequence[TrianglePrimitive]
) -> list[RefinedPrimitive]:
    """Cut a refined primitive into parts; `counts` are their faces, `sources` their primitives."""
    parts = np.arange(len(counts))
    part_of = np.empty(len(refined.attributes["POSITION"]), dtype=np.int64)
    part_of[refined.faces] = np.repeat(parts, counts)[:, None]
    order = np.argsort(part_of, kind="stable")
    starts = np.searchsorted(part_of[order], np.arange(len(counts) + 1))
    place = np.empty_like(order)
    place[order] = np.arange(len(order)) - starts[part_of[order]]
    faces = place[refined.faces]
    joined = [
        {name: v[order] for name, v in each.items()}
        for each in (refined.attributes, *refined.targets)
    ]
    ends = np.cumsum([0, *counts])
    made: list[RefinedPrimitive] = []
    for part, source in enumerate(sources):
        own = slice(starts[part], starts[part + 1])
        attributes, *targets = ({name: v[own] for name, v in each.items()} for each in joined)
        made.append(
            RefinedPrimitive(source, faces[ends[part] : ends[part + 1]], attributes, targets)
        )
    return made


def _shares(
    kept: Bool[np.ndarray, " F"], primitives: Sequence[TrianglePrimitive]
) -> list[Bool[np.ndarray, " f"]]:
    """Return each part's share of the mask of a joined primitive's faces."""
    return [kept[share] for share in slices([len(primitive.corners) for primitive in primitives])]


def _with_normal_accessor(primitive: TrianglePrimitive) -> TrianglePrimitive:
    accessors = with_normal_accessor(primitive.accessors, len(primitive.rows))
    return replace(primitive, accessors=accessors)
