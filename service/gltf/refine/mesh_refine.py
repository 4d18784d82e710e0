"""Refine control meshes with the operator: one mesh, or the parts of a union."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.carry.columns import ColumnRefinement
from pns_common.errors import MeshError
from pns_common.mesh.creases import NO_CREASES, Creases
from pns_common.mesh.mesh import Mesh
from pns_common.mesh.rows import disjoint_faces, extent
from pns_common.mesh.topology import Topology
from pns_common.operator.scheme import Scheme
from pns_common.operator.sharpness import creases_by_name
from pns_common.parallel import Blocks, available_threads
from pns_common.refined import Refinement
from pns_common.refinement import refine, refine_many
from pns_common.report import Report
from pns_common.schemes import LOOP
from pns_common.schemes.matrix import SubdivisionMatrix

from ...errors import UnrefinableError
from ...meshes.creases import chosen_creases
from ...options import Options
from ...stages import Stages
from .columns import follow, refined_skin_and_morph
from .control_mesh import ControlMesh, Parts
from .new_normals import hard_edges, marked_edges
from .skin import SkinAndMorph
from .split import Split, whole_levels, without_sides

RATIO, GATE = "_PNS_RATIO", "_PNS_GATE"


@dataclass(frozen=True, eq=False)
class RefinedMesh:
    """A refined control mesh; arrays have a row for each refined vertex.

    Attributes:
        mesh: the refined mesh.
        reports: of the operator, one for each part.
        skin_and_morph: skin binding and morph deltas.
        scalars: further attributes by name.
        limit_normals: of the limit surface, if the vertices are on it.
        split: what the kept faces were split into.
        parents: the vertices of the control mesh that each is made of; None: not asked for.
        topology: of the control mesh; None for a union.
        levels: the edges that were refined, as of `without_sides`, control mesh first; none for a
            union, and where faces have several levels.
        still: (V,) vertices of the control mesh that no chosen face has; None: all are chosen.
    """

    mesh: Mesh
    reports: list[Report]
    skin_and_morph: SkinAndMorph
    scalars: dict[str, Float[np.ndarray, " V"]]
    limit_normals: Float[np.ndarray, "V 3"] | None
    split: Split
    parents: SubdivisionMatrix | None = None
    topology: Topology | None = None
    levels: Sequence[Topology] = ()
    still: Bool[np.ndarray, " C"] | None = None


def creases_of(
    control: ControlMesh, options: Options, scheme: Scheme, parts: Parts | None = None
) -> Creases:
    """Return the edges of the mesh to refine that the options keep sharp, by name.

    With `crease=auto` these are the scheme's, and the edges that smooth shading marks as hard. Each
    of the `parts` of a union has those that it has alone.
    """
    if control.is_empty:
        return NO_CREASES
    of_parts = None
    if parts is not None and scheme.creases.learned:
        of_parts = partial(_creases_of_parts, control, parts, scheme)
    creases = chosen_creases(
        control.surface,
        options,
        scheme,
        lambda: _on_surface(control, hard_edges(control)),
        of_parts,
    )
    if options.crease != "auto" or not scheme.creases.finds:
        return creases
    return creases.with_named(_on_surface(control, marked_edges(control)))


def _on_surface(control: ControlMesh, pairs: Int[np.ndarray, "N 2"]) -> Int[np.ndarray, "N 2"]:
    """Return the edges that are none inside of a polygon, as between copies of its triangles."""
    if control.polygons is None:
        return pairs
    keys = [len(control.mesh.vertices), 1]
    edges = control.surface.topology().edges.astype(np.int64)
    return pairs[np.isin(np.sort(pairs, axis=1) @ keys, edges @ keys)]


def _creases_of_parts(control: ControlMesh, parts: Parts, scheme: Scheme) -> Creases:
    """Return the edges that are found in each part of a union, by name."""
    named, sharpness, first = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0)], 0
    corners = [np.zeros(0)]
    for mesh, _ in _jobs(
        control.mesh, parts.count_faces(control.cleaned.face_map >= 0), NO_CREASES
    ):
        found = creases_by_name(mesh, scheme.creases, scheme)
        if found.named is not None:
            named.append(first + found.named)
            own = found.sharpness
            sharpness.append(np.ones(len(found.named)) if own is None else own)
        own = found.soft_corners
        corners.append(np.zeros(len(mesh.vertices)) if own is None else own)
        first += len(mesh.vertices)
    return Creases(
        np.concatenate(named),
        np.concatenate(sharpness),
        levels=scheme.creases.levels,
        soft_corners=np.concatenate(corners),
    )


def sharp_after(creases: Creases, levels: int) -> Int[np.ndarray, "N 2"] | None:
    """Return the named edges that are sharp at the last level."""
    return creases.sharp_pairs(levels - 1)


def refined_mesh(
    control: ControlMesh,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    pointer: str,
    stages: Stages,
    *,
    traced: bool = False,
) -> RefinedMesh:
    """Refine a control mesh that has faces; `traced` asks for the parents of vertices.

    Raises:
        UnrefinableError: refined positions leave the range of float32.
    """
    try:
        made = refine(
            control.surface,
            scheme,
            options.levels,
            options.reference_length,
            limit=options.limit,
            creases=creases,
            progress=lambda done, total: stages.reach(done / total),
        )
        if not control.primitives[0].is_double:
            check_range(made.mesh)
    except MeshError as error:
        raise UnrefinableError(str(error), pointer=pointer) from error
    levels, base = made.topologies, made.scheme.base
    known = without_sides(levels, base)
    split = whole_levels(control.faces, made.mesh.corners, options.levels, base, known)
    blocks = Blocks(available_threads())
    linear = ColumnRefinement(levels, base, options.limit, blocks, made.surface)
    return RefinedMesh(
        made.mesh,
        [made.report],
        refined_skin_and_morph(control, split, linear, stages),
        _scalars(made, options),
        made.normals,
        split,
        made.parents if traced else None,
        levels[0],
        known,
    )


def refined_union(
    control: ControlMesh,
    parts: Parts,
    creases: Creases,
    scheme: Scheme,
    options: Options,
    stages: Stages,
) -> RefinedMesh:
    """Refine the parts of a union, each to the bits that it has alone.

    All primitives of a part have equal room for joints.

    Raises:
        MeshError: a part cannot be refined, or its positions leave the range of float32.
    """
    counts = parts.count_faces(control.cleaned.face_map >= 0)
    made = refine_many(
        _jobs(control.mesh, counts, creases),
        scheme,
        options.levels,
        options.reference_length,
        limit=options.limit,
    )
    for each in made:
        check_range(each.mesh)
    faces = disjoint_faces((each.mesh.faces, len(each.mesh.vertices)) for each in made)
    scalars = [_scalars(each, options) for each in made]
    normals = [each.normals for each in made if each.normals is not None]
    return RefinedMesh(
        Mesh.of_refined(np.concatenate([each.mesh.vertices for each in made]), faces),
        [each.report for each in made],
        SkinAndMorph.joined([*_followed(control, made, options, stages)]),
        {name: np.concatenate([each[name] for each in scalars]) for name in scalars[0]},
        np.concatenate(normals) if normals else None,
        whole_levels(control.faces, faces.reshape(-1), options.levels, LOOP, ()),
    )


def _followed(
    control: ControlMesh, made: Sequence[Refinement], options: Options, stages: Stages
) -> Iterator[SkinAndMorph]:
    """Yield skin and morph of each part."""
    rows, first, blocks = control.vertex_rows(), 0, Blocks(available_threads())
    for each in made:
        levels = each.topologies
        own = rows[first : first + levels[0].vertex_count]
        linear = ColumnRefinement(levels, LOOP, options.limit, blocks, each.surface)
        yield follow(control.skin_and_morph.take(own), linear, stages)
        first += len(own)


def _jobs(
    union: Mesh, counts: Int[np.ndarray, " P"], creases: Creases
) -> list[tuple[Mesh, Creases]]:
    """Return the parts of a union, whose faces and vertices follow each other, with creases."""
    named, sharpness = creases.named, creases.sharpness
    if named is None:
        named = np.zeros((0, 2), dtype=np.int64)
    ends = np.cumsum(counts)
    vertex_ends = 1 + np.maximum.reduceat(union.faces.max(axis=1), np.append(0, ends[:-1]))
    order = np.argsort(named[:, 0], kind="stable")
    named, sharpness = named[order], None if sharpness is None else sharpness[order]
    crease_ends = np.searchsorted(named[:, 0], vertex_ends)
    jobs: list[tuple[Mesh, Creases]] = []
    face, vertex, crease = 0, 0, 0
    for face_end, vertex_end, crease_end in zip(ends, vertex_ends, crease_ends, strict=True):
        mesh = Mesh(union.vertices[vertex:vertex_end], union.faces[face:face_end] - vertex)
        own = slice(crease, crease_end)
        weights = None if sharpness is None else sharpness[own]
        corners = creases.soft_corners
        corners = None if corners is None else corners[vertex:vertex_end]
        chosen = {"named": named[own] - vertex, "sharpness": weights, "soft_corners": corners}
        jobs.append((mesh, replace(creases, **chosen)))
        face, vertex, crease = face_end, vertex_end, crease_end
    return jobs


def check_range(mesh: Mesh) -> None:
    """Check that positions fit into float32. Raises MeshError."""
    low, high = extent(mesh.vertices)
    if max(-low.min(), high.max()) > np.finfo(np.float32).max:
        raise MeshError("refined positions leave the range of float32")


def _scalars(made: Refinement, options: Options) -> dict[str, Float[np.ndarray, " V"]]:
    """Return ratio and gate of the last learned level for `diagnostics=full`; otherwise nothing.

    A vertex that a later level puts on an edge or into a quad has the mean of its corners.
    """
    if options.diagnostics != "full":
        return {}
    learned = [(depth, step.added) for depth, step in enumerate(made.steps) if step.added]
    if not learned:
        return {RATIO: made.ratio, GATE: made.gate}
    depth, added = learned[-1]
    values = np.stack([added.ratio, added.gate], axis=1)
    for topology in made.topologies[depth + 1 :]:
        finer = [values, values[topology.edges].mean(axis=1)]
        if made.scheme.base.polygons:
            finer.append(values[topology.corners.reshape(-1, 4)].mean(axis=1))
        values = np.concatenate(finer)
    return {RATIO: values[:, 0], GATE: values[:, 1]}
