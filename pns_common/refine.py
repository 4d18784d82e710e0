"""Apply a scheme to a mesh, level by level: the operator's front door."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from typing import Literal, SupportsIndex, TypedDict

import numpy as np
from jaxtyping import Float, Int

from pns_common.arguments import (
    DEFAULT_LEVELS,
    check_limit,
    check_progress,
    check_reference_length,
    check_scheme,
    checked_threads,
    chosen_creases,
    levels_that_fit,
)
from pns_common.base.blocks import BLOCK_ROWS, Blocks
from pns_common.base.deferred import Deferred
from pns_common.connectivity.creases import Creases, crease_children
from pns_common.connectivity.topology import Topology
from pns_common.fused import (
    fits,
    kernel_blocks,
    kernels_available,
    kernels_loaded,
    kernels_pay,
)
from pns_common.fused.known import kernels_know
from pns_common.geometry.reference_length import measure_reference_length
from pns_common.geometry.side_lengths import measure_sides
from pns_common.levels.array_steps import array_steps
from pns_common.levels.diagnostics import LevelReport, level_report, limit_distances
from pns_common.levels.progress import level_costs, refinement_progress
from pns_common.levels.refined_levels import (
    AfterLevel,
    LevelsReport,
    RefinedLevels,
    check_coordinates,
)
from pns_common.masks.crease_shift import limit_crease_shift
from pns_common.masks.limit import refined_limit_normals, refined_limit_positions
from pns_common.mesh import Mesh, check_is_mesh
from pns_common.schemes import Scheme

NO_SHIFT = Deferred(lambda: 0.0)


class Report(TypedDict):
    """What a refinement did and how near to Loop it stayed. No times: same input, same report.

    ``prior_strength`` is s of the prior for this mesh (formula/prior_strength.py); None without a
    prior.
    ``learned_levels`` are those at which the scheme's own rules acted. ``limit_distance`` is the
    sum over all levels of the largest displacement, in the mesh's units: no vertex, and no point of
    the limit surface that Loop makes of the result, is farther than that from where Loop would have
    had it. Where edges are kept sharp, what that keeps back from Loop's smooth rules counts too.
    ``limit_distance_bound`` is the same sum of the largest displacements that the budget allows,
    and of what creases were measured to keep back; None where the scheme names no bound.
    """

    scheme: str
    budget: float | None
    model: str | None
    model_hash: str | None
    reference_length: float
    prior_strength: float | None
    multi_fan_vertices: int
    learned_levels: int
    limit_distance: float
    limit_distance_bound: float | None
    levels: list[LevelReport]


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, its report, and the last level's diagnostics at each of its vertices.

    The report is made when it is first read, from the levels, which are kept until then.
    ``ratio`` and ``gate`` are 0 at old vertices, but where the model has a vertex rule.
    ``normals`` are the limit surface's, exact, where the vertices were put on it; on creases the
    mean of both sides'. Without ``limit=True`` they are None.
    """

    mesh: Mesh
    make_report: Deferred[Report]
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]
    normals: Float[np.ndarray, "V 3"] | None = None

    @property
    def report(self) -> Report:
        """What the refinement did, and how near to Loop it stayed."""
        return self.make_report()

    def __repr__(self) -> str:
        scheme, levels = self.report["scheme"], len(self.report["levels"])
        vertices, faces = len(self.mesh.vertices), len(self.mesh.faces)
        return f"Refinement({scheme!r}, levels={levels}, vertices={vertices}, faces={faces})"


def refine(
    mesh: Mesh,
    scheme: Scheme,
    levels: SupportsIndex = DEFAULT_LEVELS,
    reference_length: float | str = "auto",
    *,
    limit: bool = False,
    creases: Int[np.ndarray, "N 2"] | Creases | Literal["auto"] | None = "auto",
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Refinement:
    """Refine a mesh. Each level splits every face in four; nothing is renumbered.

    Args:
        mesh: the control mesh.
        scheme: ``loop()``, ``pns(model)`` or any other.
        levels: number of steps, 1 … 16, by default 2; fewer where the result cannot fit into the
            memory here.
        reference_length: R, the unit of length of the budget: the largest curvature that the
            budget C can represent is 8 C / R. "auto" measures the mesh; 1 is the paper's absolute
            unit. It is fixed here for all levels: pass the first call's R when calling again.
        limit: put the last level's vertices where Loop's rules would take them if they went on for
            ever, and give the limit surface's normals there. The report is that of the levels.
        creases: edges to keep sharp, as pairs of vertices: the rules of Hoppe et al. 1994, and of
            corrections only that of curves, where the model has it (formula/curve_prior.py). Their
            children are creases too; boundary and irregular edges stay what they are. "auto": the
            crease lines that the mesh shows (``crease_lines``), where the model's card asks for
            them, sharp at as many levels as it says; None: no edge. ``Creases`` says of pairs at
            how many levels they are sharp.
        threads: worker threads, default all processors; the result does not depend on it.
        progress: called as the work goes on, inside levels too, with (faces made so far, faces made
            in the end). It may be called from another thread, one at a time; what it raises ends
            the refinement, and is raised here.

    Raises:
        ParameterError: no Mesh or no Scheme; levels, reference_length or threads out of range; a
            limit that is no bool, a progress that cannot be called; a crease that is no edge; a
            rule that returns no placement, or one of other vertices.
        ModelError: the network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large, or not numbers.
    """
    check_is_mesh(mesh)
    check_scheme(scheme)
    levels = levels_that_fit(levels, len(mesh.faces))
    check_reference_length(reference_length)
    check_limit(limit)
    check_progress(progress)
    workers = checked_threads(threads)
    length = Deferred(lambda: _length_of(mesh, reference_length, workers))
    work = refinement_progress(len(mesh.faces), levels, scheme.learned_levels, limit, progress)
    costs = level_costs(len(mesh.faces), levels, scheme.learned_levels)
    # Loop has no use for a unit of length; its report names one when it is read.
    unit = 1.0 if scheme.learned_levels == 0 else length()
    kept = chosen_creases(creases, scheme)
    if kernels_can_serve(mesh, scheme, levels, unit) and kernels_pay(costs):
        # Loads the compiler's runtime, which whoever only imports the package does not need.
        from pns_common.fused.levels.side_lengths import side_lengths
        from pns_common.fused.refine import refine_fused

        blocks = kernel_blocks(workers, work.rows)
        scheme = scheme.fitted(lambda: side_lengths(mesh.vertices, mesh.faces, blocks))
        made = refine_fused(mesh, scheme, levels, unit, kept, blocks, work.level_ends)
    else:
        blocks = Blocks(workers, BLOCK_ROWS, work.rows)
        scheme = scheme.fitted(lambda: measure_sides(mesh.vertices, mesh.faces))
        made = refine_arrays(mesh, scheme, levels, unit, kept, blocks, work.level_ends)
    points, normals, kept_back = made.points, None, NO_SHIFT
    if limit:
        topology, blocks = made.split_topology(), Blocks(workers, BLOCK_ROWS, work.rows)
        kept_back = Deferred(lambda: limit_shift(made.points, made.faces, topology))
        points = refined_limit_positions(made.points, topology, blocks)
        normals = refined_limit_normals(made.points, topology, blocks)
        work.level_ends()
    return Refinement(
        mesh=Mesh.of_refined(points, made.faces),
        make_report=Deferred(
            lambda: report_of(scheme, length(), made.multi_fan_vertices, made.reports, kept_back())
        ),
        ratio=made.ratio,
        gate=made.gate,
        normals=normals,
    )


def report_of(
    scheme: Scheme,
    reference_length: float,
    multi_fan_vertices: int,
    levels: list[LevelReport],
    limit_shift: float = 0.0,
) -> Report:
    """Make the report of a refinement from those of its levels; the last as of limit_distances."""
    return {
        "scheme": scheme.name,
        "budget": scheme.budget,
        "model": scheme.model,
        "model_hash": scheme.model_hash,
        "reference_length": reference_length,
        "prior_strength": scheme.prior_strength,
        "multi_fan_vertices": multi_fan_vertices,
        **limit_distances(levels, limit_shift),
        "levels": levels,
    }


def refine_arrays(
    mesh: Mesh,
    scheme: Scheme,
    levels: int,
    reference_length: float,
    creases: Creases,
    blocks: Blocks,
    after_level: AfterLevel,
) -> RefinedLevels:
    """Go through the levels with the array kernels, which serve every scheme.

    Raises:
        ParameterError: a crease is no edge; a rule returned no placement, or one of other vertices.
        ModelError: the network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large, or not numbers.
    """
    steps = array_steps(mesh.vertices, mesh.faces, creases, scheme, reference_length, blocks)
    reports: list[LevelReport] = []
    multi_fan_vertices, last = 0, None
    for last in islice(steps, levels):
        if last.multi_fan_vertices is not None:
            multi_fan_vertices = int(last.multi_fan_vertices.sum())
        check_coordinates(np.abs(last.placed.points).max())
        reports.append(level_report(last.topology, last.placed, last.children, last.crease_shift))
        after_level()
    assert last is not None  # levels ≥ 1
    placed, topology = last.placed, last.topology
    ratio = np.concatenate([placed.vertices.ratio, placed.edges.ratio])
    gate = np.concatenate([placed.vertices.gate, placed.edges.gate])
    looked_at = Deferred(lambda: LevelsReport(reports, multi_fan_vertices))
    return RefinedLevels(placed.points, last.faces, ratio, gate, looked_at, lambda: topology)


def kernels_can_serve(
    mesh: Mesh,
    scheme: Scheme,
    levels: int,
    reference_length: float,
) -> bool:
    """Return whether compiled kernels can take the array kernels' place, with the same bits."""
    if not (kernels_available() and fits(len(mesh.vertices), len(mesh.faces), levels)):
        return False
    return scheme.learned_levels == 0 or (reference_length > 0 and kernels_know(scheme))


def limit_shift(
    points: Float[np.ndarray, "W 3"], faces: Int[np.ndarray, "C 3"], topology: Topology
) -> float:
    """Return the longest way that creases keep a limit from Loop's; ``topology`` was split last."""
    shift = limit_crease_shift(points, faces, crease_children(topology))
    return 0.0 if shift is None else shift.largest


def reference_length_of(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], threads: int = 1
) -> float:
    """Return R of a mesh, by kernels where they are loaded."""
    if kernels_available() and kernels_loaded():
        from pns_common.fused.where_loaded.extent import reference_length

        return reference_length(vertices, faces, kernel_blocks(threads))
    return measure_reference_length(vertices, faces)


def _length_of(mesh: Mesh, given: float | str, threads: int) -> float:
    if given != "auto":
        return float(given)
    return reference_length_of(mesh.vertices, mesh.faces, threads)
