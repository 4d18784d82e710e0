"""Refine all meshes of a file in order: small ones together, large ones alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np

from pns_common.mesh.creases import Creases
from pns_common.operator.scheme import Scheme
from pns_common.progress import LEARNED_COST
from pns_common.schemes.matrix import SubdivisionMatrix

from ...advice import NO_BENDS, count_bends
from ...errors import InvalidParameter
from ...options import Limits, Options
from ...stages import Stages
from ..read.plan import MeshPlan
from ..read.primitives import TrianglePrimitive, read_primitive
from ..read.upload import Upload
from .adaptive import refine_to_goal
from .attributes import RefinedPrimitive, refined_primitives
from .batch import (
    NOTHING_LOST,
    MeshOutcome,
    StageShares,
    kind_of,
    outcome_of,
    refine_batch,
)
from .changes import near_misses
from .control_mesh import ControlMesh, control_mesh
from .mesh_refine import (
    creases_of,
    refined_mesh,
    sharp_after,
)
from .new_normals import with_normal_rule, with_smooth_normals
from .outlines import refined_outlines, with_outline
from .polygons import Found, find_polygons
from .selection import Chosen, chosen_primitives, keep_chosen

# Above so many refined faces a mesh is refined alone: its own work outweighs the fixed cost.
MOST_FACES = 2**15
# Refined faces of meshes that are refined together; bounds their memory.
GROUP_FACES = 2**17

# Costs of stages for each refined face, where refining by Loop with its report costs 1. Measured
# on a part of 2,000 faces with normals and texture coordinates at four and five levels.
READ, WELD, LIMIT, ATTRIBUTES = 0.05, 0.05, 2.0, 1.7
# The same with a goal, by Loop; what is learned adds to the first.
GOAL, GOAL_ATTRIBUTES = 12.0, 8.0
WRITE = {"none": 0.1, "meshopt": 2.5, "draco": 25.0}


def refined_meshes(
    upload: Upload,
    plans: Sequence[MeshPlan],
    scheme: Scheme,
    options: Options,
    stages: Stages,
    limits: Limits,
    *,
    traced: bool = False,
) -> Iterator[MeshOutcome]:
    """Refine meshes of an upload; each is yielded inside the stages' part for its writing.

    `traced` asks for the parents of vertices.

    Raises:
        ServiceError: a mesh is invalid, or cannot be refined.
        pns_common.errors.ModelError: the model's answer is no correction.
    """
    shares = stage_shares(scheme, options)
    total, done = sum(plan.faces for plan in plans), 0
    most = options.max_faces
    if most is not None and len(plans) > 1 and most < total:
        least = f"must be at least {total}: faces are split, never joined"
        raise InvalidParameter("max_faces", f"max_faces is {most}; it {least}")
    chosen = chosen_primitives(upload, options)
    # Each mesh has its share of `max_faces`.
    windows = _windows(plans, options.levels) if most is None else ([plan] for plan in plans)
    for window in windows:
        count = sum(plan.faces for plan in window)
        own = options if most is None else replace(options, max_faces=most * count // total)
        with stages.part(done / total, (done + count) / total):
            yield from _window(
                upload, window, scheme, own, stages, shares, chosen, limits, traced=traced
            )
        done += count


def mostly_polygons(upload: Upload) -> bool:
    """Return whether half of a file's triangles or more are parts of larger polygons."""
    joined = total = 0
    for plan in upload.plans:
        for primitive in _read(upload, plan):
            total += len(primitive.corners)
            joined += find_polygons(primitive, "auto").joined
    return 2 * joined >= total


def stage_shares(scheme: Scheme, options: Options) -> StageShares:
    """Return where the stages of a mesh begin, by their measured costs."""
    if options.goals:
        return _shares(GOAL, GOAL_ATTRIBUTES, options)
    made = [4**level for level in range(1, options.levels + 1)]
    learned = made if scheme.learned_levels is None else made[: scheme.learned_levels]
    refine = 1 + LEARNED_COST * sum(learned) / sum(made) + LIMIT * options.limit
    return _shares(refine, ATTRIBUTES, options)


def _shares(refine: float, attributes: float, options: Options) -> StageShares:
    costs = [READ, WELD, refine, attributes, WRITE[options.compress]]
    return StageShares(*(end / sum(costs) for end in list(accumulate(costs))[:-1]))


def _windows(plans: Sequence[MeshPlan], levels: int) -> Iterator[list[MeshPlan]]:
    """Yield runs of small meshes, and every other mesh alone."""
    window: list[MeshPlan] = []
    held = 0
    for plan in plans:
        faces = plan.faces * 4**levels
        small = faces <= MOST_FACES
        if window and (not small or held + faces > GROUP_FACES):
            yield window
            window, held = [], 0
        if small:
            window.append(plan)
            held += faces
        else:
            yield [plan]
    if window:
        yield window


def _window(
    upload: Upload,
    window: Sequence[MeshPlan],
    scheme: Scheme,
    options: Options,
    stages: Stages,
    shares: StageShares,
    chosen: dict[tuple[int, int], bool] | None,
    limits: Limits,
    *,
    traced: bool,
) -> Iterator[MeshOutcome]:
    with stages.stage("read", 0.0, shares.weld):
        read = [_read(upload, plan) for plan in window]
    outcomes: dict[int, MeshOutcome] = {}
    # Rows of a union are numbered anew, and its faces are refined alike.
    alike = chosen is None and not traced and not scheme.base.polygons and not options.goals
    if len(window) > 1 and options.weld == "position" and alike:
        outcomes = _together(window, read, scheme, options, stages, shares)
    alone = [place for place in range(len(window)) if place not in outcomes]
    for done, place in enumerate(alone):
        with stages.part(done / len(alone), (done + 1) / len(alone)):
            plan, own = window[place], None
            if chosen is not None:
                own = [np.full(len(p.corners), chosen[plan.mesh, p.number]) for p in read[place]]
            found = None
            if scheme.base.polygons:
                found = [find_polygons(p, options.polygons) for p in read[place]]
            outcomes[place] = refine_alone(
                plan,
                read[place],
                scheme,
                options,
                stages,
                shares,
                traced=traced,
                chosen=own,
                found=found,
                limits=limits,
            )
    with stages.part(shares.write, 1.0):
        for place in range(len(window)):
            with stages.part(place / len(window), (place + 1) / len(window)):
                yield outcomes.pop(place)


def _read(upload: Upload, plan: MeshPlan) -> list[TrianglePrimitive]:
    return [
        read_primitive(upload.document, upload.buffers, plan.mesh, number)
        for number in plan.primitives
    ]


def _together(
    window: Sequence[MeshPlan],
    read: Sequence[list[TrianglePrimitive]],
    scheme: Scheme,
    options: Options,
    stages: Stages,
    shares: StageShares,
) -> dict[int, MeshOutcome]:
    """Refine the meshes of a window that can be joined; return them by their place in it."""
    groups: defaultdict[Hashable, list[int]] = defaultdict(list)
    for place, primitives in enumerate(read):
        kind = kind_of(primitives)
        if kind is not None:
            groups[kind, with_normal_rule(options, primitives).normals].append(place)
    outcomes: dict[int, MeshOutcome] = {}
    for number, places in enumerate(groups.values()):
        meshes = [read[place] for place in places]
        numbers = [window[place].mesh for place in places]
        with stages.part(number / len(groups), (number + 1) / len(groups)):
            made = refine_batch(meshes, numbers, scheme, options, stages, shares)
        outcomes |= {p: o for p, o in zip(places, made, strict=True) if o is not None}
    return outcomes


def refine_alone(
    plan: MeshPlan,
    primitives: list[TrianglePrimitive],
    scheme: Scheme,
    options: Options,
    stages: Stages,
    shares: StageShares,
    *,
    traced: bool = False,
    chosen: Chosen | None = None,
    found: Sequence[Found] | None = None,
    stated: Callable[[ControlMesh, Creases], Creases] | None = None,
    limits: Limits | None = None,
) -> MeshOutcome:
    """Refine one mesh, given by its primitives.

    `traced` asks for the parents of vertices; `chosen` faces of each primitive are refined alone;
    `found` are polygons of its triangles, for a scheme of polygons; `stated` adds creases to
    those that the options ask for; `limits` bound faces of several levels, of which the number is
    known when they are made.
    """
    options = with_normal_rule(options, primitives)
    with stages.stage("weld", shares.weld, shares.refine):
        control = control_mesh(primitives, options)
        if found is not None:
            control = control.joined(found)
        creases = creases_of(control, options, scheme)
        if stated is not None and not control.is_empty:
            creases = stated(control, creases)
        if options.normals != "keep" and not control.is_empty:
            primitives = with_smooth_normals(control, sharp_after(creases, options.levels))
            control = control.with_new_normals(primitives)
    pointer, made = f"/meshes/{plan.mesh}", None
    refined: list[RefinedPrimitive] = []
    with stages.stage("refine", shares.refine, shares.attributes):
        if not control.is_empty and options.goals:
            asked = control, creases, scheme, options, limits or Limits(), pointer, stages
            made = refine_to_goal(*asked, traced=traced)
        elif not control.is_empty:
            made = refined_mesh(control, creases, scheme, options, pointer, stages, traced=traced)
            if chosen is not None:
                made = keep_chosen(made, control, chosen)
    with stages.stage("attributes", shares.attributes, shares.write):
        if made is not None:
            refined = refined_primitives(control, made, creases, options, stages)
            outlines = refined_outlines(control, made.levels)
            refined = [with_outline(each, outlines) for each in refined]
    misses, lost = 0, NOTHING_LOST
    if made is not None and made.topology is not None:
        length, lost = made.reports[0]["reference_length"], made.skin_and_morph.losses[0]
        (misses,) = near_misses(control.surface.vertices, made.topology, [length])
    return outcome_of(
        plan.mesh,
        primitives,
        control.kept,
        refined,
        options.levels,
        int(control.near[0]),
        misses,
        lost,
        copies=control.copies,
        report=None if made is None else made.reports[0],
        bends=NO_BENDS if made is None else count_bends(control.surface, creases, options)[0],
        parents=None if made is None or made.parents is None else _of_rows(made.parents, control),
    )


def _of_rows(parents: SubdivisionMatrix, control: ControlMesh) -> SubdivisionMatrix:
    """Return parents by their rows in the primitives, of which the first of each weld counts."""
    shape = (parents.shape[0], len(control.weld.vertex_of))
    return replace(parents, columns=control.vertex_rows()[parents.columns], shape=shape)
