"""All meshes of a file, refined in the file's order: small ones together, large ones alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from pns_common.refine import Report
from pns_common.schemes import Scheme

from ...course import Course
from ...meshes.barycentric_grid import barycentric_grid
from ...meshes.uv_charts import uv_blend
from ...options import Options
from ...report import Change
from ..read.plan import MeshPlan
from ..read.primitives import TrianglePrimitive, read_primitive
from ..read.upload import Upload
from ..stage_shares import StageShares, stage_shares
from .control_mesh import control_mesh
from .refined_primitives import RefinedPrimitive, refined_primitives
from .refinement import changes_of_mesh, creases_of, refine_control_mesh
from .smooth_normals import with_smooth_normals
from .together import GROUP_FACES, MOST_FACES, refine_together
from .union import kind_of


@dataclass(frozen=True, eq=False)
class MeshOutcome:
    """What became of a mesh.

    Attributes:
        index: its place in the file's `meshes`.
        primitives: its triangle primitives.
        kept: for each of them, which of its faces do not name a welded vertex twice.
        refined: those that have a face left.
        copies: faces that follow another with the same vertices.
        report: the operator's; None where no face was left.
        changes: what was joined, dropped or cut.
    """

    index: int
    primitives: Sequence[TrianglePrimitive]
    kept: Sequence[Bool[np.ndarray, " F"]]
    refined: Sequence[RefinedPrimitive]
    copies: int
    report: Report | None
    changes: list[Change]

    @property
    def degenerate(self) -> int:
        """Faces that name a welded vertex twice."""
        return sum(int((~keep).sum()) for keep in self.kept)

    def of(self, mesh: int) -> MeshOutcome:
        """Return the same, of another mesh with the same geometry."""
        before, after = (f"/meshes/{index}" for index in (self.index, mesh))
        moved = [
            Change(after + change.pointer.removeprefix(before), change.what, change.count)
            for change in self.changes
        ]
        return replace(self, index=mesh, changes=moved)


def refined_meshes(
    upload: Upload, plans: Sequence[MeshPlan], scheme: Scheme, options: Options, course: Course
) -> Iterator[MeshOutcome]:
    """Refine meshes of an upload.

    Each is handed out inside the part of the course in which it is to be written.

    Raises:
        ServiceError: a mesh breaks its promises, or cannot be refined.
        pns_common.errors.ModelError: the model answered with something that is no correction.
    """
    shares = stage_shares(scheme, options)
    total, done = sum(plan.faces for plan in plans), 0
    for window in _windows(plans, options.levels):
        count = sum(plan.faces for plan in window)
        with course.part(done / total, (done + count) / total):
            yield from _window(upload, window, scheme, options, course, shares)
        done += count


def _windows(plans: Sequence[MeshPlan], levels: int) -> Iterator[list[MeshPlan]]:
    """Yield runs of small meshes, and each other mesh for itself."""
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
    course: Course,
    shares: StageShares,
) -> Iterator[MeshOutcome]:
    with course.stage("read", 0.0, shares.weld):
        read = [_read(upload, plan) for plan in window]
    outcomes: dict[int, MeshOutcome] = {}
    if len(window) > 1:
        outcomes = _together(window, read, scheme, options, course, shares)
    alone = [place for place in range(len(window)) if place not in outcomes]
    for done, place in enumerate(alone):
        with course.part(done / len(alone), (done + 1) / len(alone)):
            plan = window[place]
            outcomes[place] = refine_alone(plan, read[place], scheme, options, course, shares)
    with course.part(shares.write, 1.0):
        for place in range(len(window)):
            with course.part(place / len(window), (place + 1) / len(window)):
                yield outcomes.pop(place)


def _together(
    window: Sequence[MeshPlan],
    read: Sequence[list[TrianglePrimitive]],
    scheme: Scheme,
    options: Options,
    course: Course,
    shares: StageShares,
) -> dict[int, MeshOutcome]:
    """Refine those meshes of a window together that can be; by their places in it."""
    groups: defaultdict[Hashable, list[int]] = defaultdict(list)
    for place, primitives in enumerate(read):
        kind = kind_of(primitives)
        if kind is not None:
            groups[kind].append(place)
    outcomes: dict[int, MeshOutcome] = {}
    for number, places in enumerate(groups.values()):
        meshes = [read[place] for place in places]
        pointers = [f"/meshes/{window[place].mesh}" for place in places]
        with course.part(number / len(groups), (number + 1) / len(groups)):
            made = refine_together(meshes, pointers, scheme, options, course, shares)
        for place, part in zip(places, made, strict=True):
            if part is not None:
                outcomes[place] = MeshOutcome(
                    index=window[place].mesh,
                    primitives=read[place],
                    kept=part.kept,
                    refined=part.refined,
                    copies=part.copies,
                    report=part.report,
                    changes=part.changes,
                )
    return outcomes


def _read(upload: Upload, plan: MeshPlan) -> list[TrianglePrimitive]:
    return [
        read_primitive(upload.document, upload.buffers, plan.mesh, number)
        for number in plan.primitives
    ]


def refine_alone(
    plan: MeshPlan,
    primitives: list[TrianglePrimitive],
    scheme: Scheme,
    options: Options,
    course: Course,
    shares: StageShares,
) -> MeshOutcome:
    """Refine one mesh, given by its primitives."""
    with course.stage("weld", shares.weld, shares.refine):
        control = control_mesh(primitives, options.weld_tolerance, options.weld_unit)
        creases = creases_of(control, options, scheme)
        if options.normals != "keep" and control.cleaned is not None:
            sharp = creases.left_after(options.levels)
            primitives = with_smooth_normals(control, control.cleaned, sharp)
            control = control.with_new_normals(primitives)
    pointer = f"/meshes/{plan.mesh}"
    with course.stage("refine", shares.refine, shares.attributes):
        made = refine_control_mesh(control, creases, scheme, options, pointer, course)
        # Read here, since the levels' tables are kept until it is.
        report = None if made is None else made.refinement.report
    refined: list[RefinedPrimitive] = []
    with course.stage("attributes", shares.attributes, shares.write):
        if made is not None and control.cleaned is not None:
            grid, blend = barycentric_grid(options.levels), uv_blend(options, creases)
            refined = refined_primitives(control, control.cleaned, made, grid, blend, course)
    return MeshOutcome(
        index=plan.mesh,
        primitives=primitives,
        kept=control.kept,
        refined=refined,
        copies=control.copies,
        report=report,
        changes=changes_of_mesh(control, made, options.levels, pointer),
    )
