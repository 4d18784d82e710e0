"""Apply a scheme to a mesh, level by level: the front door of the operator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Literal, SupportsIndex

import numpy as np
from jaxtyping import Integer

from pns_common.errors import MeshError, ParameterError
from pns_common.memory import keep_freed_memory, memory_here
from pns_common.mesh.creases import Creases, chosen_creases, one_of_creases
from pns_common.mesh.mesh import Mesh, check_is_mesh
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.mesh.selection import chosen_faces, select
from pns_common.mesh.topology import QUAD, TRIANGLE
from pns_common.operator.level import Level
from pns_common.operator.scheme import NAMES, Scheme, named_scheme
from pns_common.operator.sharpness import with_sharp_edges
from pns_common.parallel import Blocks, available_threads, no_progress
from pns_common.parameters import is_bool, is_number, is_whole
from pns_common.progress import Progress, Shares
from pns_common.refined import Refinement, Step, check_coordinates
from pns_common.schemes.limit import limit_positions

DEFAULT_LEVELS, HIGHEST_LEVELS = 2, 16
# With a tolerance, or the like, so many levels are used at most.
DEFAULT_DEEPEST = 6
# No refinement takes less for a face that it makes.
LEAST_BYTES_PER_FACE = 60
# Half-edges are numbered in 32 bits.
LARGEST_INDEX = 2**31 - 1

PROGRESS = "a function of two whole numbers, or None"

keep_freed_memory()


def refine(
    mesh: Mesh,
    scheme: Scheme | str,
    levels: SupportsIndex | None = None,
    reference_length: float | str = "auto",
    *,
    tolerance: float | str | None = None,
    angle: float | None = None,
    max_faces: int | None = None,
    max_edge_length: float | str | None = None,
    limit: bool = True,
    creases: Integer[np.ndarray, "N 2"] | Creases | str | None = "auto",
    crease: Integer[np.ndarray, "N 2"] | Creases | str | None = "auto",
    border: Literal["smooth", "corners", "fixed"] | None = None,
    faces: Any = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Refinement:
    """Refine a mesh. Nothing is renumbered.

    Loop's scheme splits triangles in four; Catmull–Clark's splits faces of any degree into quads.

    Args:
        mesh: the control mesh.
        scheme: ``loop()``, ``catmull_clark()``, ``pns(model)``, or the name "loop",
            "catmull-clark" or "pns", the default model. The default model refines triangles by
            Loop's scheme; a mesh with other faces goes to its companion over Catmull–Clark.
        levels: number of steps, 1 … 16; fewer where the result cannot fit into the memory here.
            None: 2, or with a tolerance or one of the next three 6, of which each face takes as
            many as it needs.
        reference_length: R, the unit of length of the budget: the largest curvature that the
            budget C can represent is 8 C / R. "auto" measures the mesh; 1 is the paper's absolute
            unit. It is fixed here for all levels: pass the first call's R when calling again.
        tolerance: split faces that may be farther from the limit surface, alone; in the mesh's
            units, or a share of the diagonal of its box, as "0.1%". The result is an
            ``AdaptiveRefinement``: faces of several levels, which meet without gaps. For triangles.
        angle: split faces over which shading turns by more degrees: between the normals of the
            limit surface at their corners and where the next level has vertices on their sides.
        max_faces: split the faces of the largest distance first, and end before there are more.
        max_edge_length: split faces with longer sides; as ``tolerance``.
        limit: put the last level's vertices where the base scheme would take them if it were
            applied for ever, and return the limit surface's normals there: then the number of
            levels says how fine the mesh is and no longer changes its shape. False: leave them as
            they are, as control points of what follows. A base scheme without limit masks leaves
            them in either case.
        creases: edges to keep sharp, as pairs of vertices: for good, boundaries alike (Hoppe et al.
            1994). "auto": the scheme's own, at as many levels as the model's card says: each edge
            as sharp as the sharpness network finds it; none without one. "off" or None: no edge.
            "angle:40": edges that turn by more than 40 degrees.
        crease: another name of ``creases``, as the command line has it.
        border: what boundaries do; see ``Creases``. None: as ``creases`` say, or "smooth".
        faces: refine these alone, by number or as a mask. Triangles beside them are cut to meet
            them; over Catmull–Clark any face beside them gets their new vertices as corners. Other
            vertices stay. The report is that of refining all.
        threads: worker threads, default all processors; the result does not depend on it.
        progress: called with (faces made so far, faces made in the end), also inside levels, from
            any thread, one at a time; an exception that it raises ends the refinement. With a
            tolerance or the like both are estimates, of which the quotient never falls.

    Raises:
        ParameterError: an argument out of range, or a crease that is no edge.
        ModelError: the network's answer is not finite, or has another shape.
        MeshError: the refined coordinates are too large, or not numbers.

    Example:
        >>> mesh = Mesh(np.eye(4, 3), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> refine(mesh, "loop", levels=2).mesh.face_count
        64
    """
    check_is_mesh(mesh)
    scheme = scheme_for(mesh, scheme)
    goals = tolerance, angle, max_faces, max_edge_length
    if any(goal is not None for goal in goals):
        return _refine_to_goal(
            mesh,
            scheme,
            levels,
            reference_length,
            goals,
            limit=limit,
            creases=one_of_creases(creases, crease),
            border=border,
            faces=faces,
            threads=threads,
            progress=progress,
        )
    levels = DEFAULT_LEVELS if levels is None else levels
    children = len(mesh.corners) if scheme.base.polygons else 4 * mesh.face_count
    count = levels_that_fit(levels, children, QUAD if scheme.base.polygons else TRIANGLE)
    length = _reference_length(mesh, reference_length, measured=scheme.rule is not None)
    if not is_bool(limit):
        raise ParameterError("limit", limit, expected="True or False")
    kept = chosen_creases(one_of_creases(creases, crease), scheme.creases)
    kept = kept if border is None else replace(kept, border=border)
    learned = count if scheme.learned_levels is None else min(count, scheme.learned_levels)
    limit = limit and scheme.base.limit is not None
    told = _progress(children, count, learned if scheme.rule else 0, limit, progress)
    blocks = Blocks(_threads(threads), no_progress if told is None else told.rows)
    chosen = None if faces is None else chosen_faces(faces, mesh.face_count)

    level = Level(mesh.vertices, mesh.topology(blocks), scheme.base, length, blocks)
    level, steps = with_sharp_edges(level, kept, scheme), list[Step]()
    for depth in range(count):
        if steps:
            topology = scheme.base.split(level.topology, blocks, inherit=kept.sharp_at(depth))
            level = Level(steps[-1].points, topology, scheme.base, length, blocks)
        steps.append(_step(level, scheme, depth))
        level = steps[-1].level  # without measurements
        if told:
            told.level_ends()
    points, last = steps[-1].points, None
    if not limit:
        refined = scheme.base.faces(level.topology, blocks, np.int64)
    else:
        last = scheme.base.split(level.topology, blocks)
        refined = last.corners.astype(np.int64).reshape(last.face_count, -1)
        points = limit_positions(points, last, blocks, scheme.base)
        if told:
            told.level_ends()
    added, nothing = steps[-1].added, np.broadcast_to(0.0, len(points))
    ratio, gate = (nothing, nothing) if added is None else (added.ratio, added.gate)
    selected = None
    if chosen is not None:
        selected = select(chosen, steps[0].level.topology, refined, len(points), count)
        rows = selected.vertices
        points, ratio, gate = points[rows], ratio[rows], gate[rows]
        points[: len(mesh.vertices)][selected.still] = mesh.vertices[selected.still]
    return Refinement(
        mesh=Mesh.of_refined(points, refined)
        if selected is None
        else Mesh.of_refined(points, selected.corners, selected.offsets),
        ratio=ratio,
        gate=gate,
        steps=steps,
        scheme=scheme,
        surface=last,
        selected=selected,
    )


def _refine_to_goal(
    mesh: Mesh,
    scheme: Scheme,
    levels: SupportsIndex | None,
    reference_length: float | str,
    goals: tuple[Any, Any, Any, Any],
    *,
    limit: bool,
    creases: Integer[np.ndarray, "N 2"] | Creases | str | None,
    border: Literal["smooth", "corners", "fixed"] | None,
    faces: Any,
    threads: int | None,
    progress: Callable[[int, int], None] | None,
) -> Refinement:
    """Refine a mesh of triangles until a goal is reached; arguments as of ``refine``."""
    from pns_common.adaptive.refine import LEARNED, goal_of, refine_to_goal

    given = "a tolerance, angle, max_faces or max_edge_length"
    if scheme.base.polygons:
        expected = f"loop or pns on triangles with {given}: polygons are refined by whole levels"
        raise ParameterError("scheme", scheme.name, expected=expected)
    if scheme.rule is not None and scheme.learned_levels != 1:
        expected = f"a model that acts at the first level alone with {given}"
        raise ParameterError("scheme", str(scheme.model), expected=expected)
    if limit is not True:
        raise ParameterError("limit", limit, expected=f"True with {given}")
    if faces is not None:
        raise ParameterError("faces", "given", expected=f"None with {given}")
    if progress is not None and not callable(progress):
        raise ParameterError("progress", progress, expected=PROGRESS)
    deepest = levels_given(DEFAULT_DEEPEST if levels is None else levels)
    goal = goal_of(mesh, *goals)
    length = _reference_length(mesh, reference_length, measured=scheme.rule is not None)
    kept = chosen_creases(creases, scheme.creases)
    kept = kept if border is None else replace(kept, border=border)
    shares, faces = Shares(progress), mesh.face_count

    def tell(done: int, total: int) -> None:
        shares.reach(done / total, faces)

    learns = scheme.acts_at(0) and bool(length)
    told = _progress(4 * faces, 1, 1, False, tell if learns and progress else None)
    blocks = Blocks(_threads(threads), no_progress if told is None else told.rows)
    shares.part(0.0, LEARNED)
    level = Level(mesh.vertices, mesh.topology(blocks), scheme.base, length, blocks)
    level = with_sharp_edges(level, kept, scheme)
    first = _step(level, scheme, 0) if learns else None
    made = refine_to_goal(level, first, scheme, kept, goal, deepest, shares)
    if progress is not None:
        progress(made.mesh.face_count, made.mesh.face_count)
    return made


def scheme_for(mesh: Mesh, scheme: Scheme | str) -> Scheme:
    """Return the scheme that refines a mesh: that of a name, or a companion for polygons.

    Raises:
        ParameterError: it is neither a scheme nor a name of one.
        MeshError: the mesh has polygons, and the scheme refines triangles alone.
    """
    if isinstance(scheme, str):
        scheme = named_scheme(scheme)
    if not isinstance(scheme, Scheme):  # pyright: ignore[reportUnnecessaryIsInstance]
        expected = f"a Scheme, as loop() or pns(load_model()), or one of {', '.join(NAMES)}"
        raise ParameterError("scheme", type(scheme), expected=expected)
    if mesh.triangles or scheme.base.polygons:
        return scheme
    if scheme.for_polygons is None:
        reason = (
            f"polygons, expected triangles for {scheme.base.name}; catmull-clark takes polygons"
        )
        raise MeshError(reason, element="faces")
    return scheme.for_polygons()


def control_level(
    mesh: Mesh,
    scheme: Scheme,
    reference_length: float | str = "auto",
    creases: Integer[np.ndarray, "N 2"] | Creases | str | None = "auto",
    threads: int | None = None,
) -> Level:
    """Return the level that the first step of ``refine`` reads: for training and experiments.

    ``operator.surroundings``, ``edge_inputs`` and ``guard_scale`` take it.

    Raises:
        ParameterError: an argument out of range, or a crease that is no edge.
    """
    blocks = Blocks(_threads(threads))
    kept = chosen_creases(creases, scheme.creases)
    length = _reference_length(mesh, reference_length, measured=True)
    level = Level(mesh.vertices, mesh.topology(blocks), scheme.base, length, blocks)
    return with_sharp_edges(level, kept, scheme)


def refine_many(
    jobs: Iterable[tuple[Mesh, Creases | None]],
    scheme: Scheme,
    levels: SupportsIndex = DEFAULT_LEVELS,
    reference_length: float | str = "auto",
    *,
    limit: bool = True,
    threads: int | None = None,
) -> list[Refinement]:
    """Refine meshes one after the other, each with its own creases; None: no edge.

    Example:
        >>> mesh = Mesh(np.eye(4, 3), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> [made] = refine_many([(mesh, None)], named_scheme("loop"), levels=1)
        >>> made.mesh.face_count
        16
    """
    return [
        refine(
            mesh, scheme, levels, reference_length, limit=limit, creases=creases, threads=threads
        )
        for mesh, creases in jobs
    ]


def _step(level: Level, scheme: Scheme, depth: int) -> Step:
    """Refine one level."""
    added = None
    if scheme.acts_at(depth) and level.reference_length and scheme.rule is not None:
        # An absurd budget overflows, which is caught just below.
        with np.errstate(over="ignore", invalid="ignore"):
            added = scheme.rule(level)
        points = added.points
        check_coordinates(points, level.blocks)
    else:
        # Means of points: not farther out than these.
        points = level.base.place(level.points, level.topology, level.blocks)
    kept = Level(level.points, level.topology, level.base, level.reference_length, level.blocks)
    return Step(kept, points, added)  # without measurements, which are most of the memory


def levels_that_fit(given: SupportsIndex, children: int, degree: int) -> int:
    """Return the number of levels as int.

    Args:
        given: what was asked for.
        children: how many faces the first level makes; each later one splits them in four.
        degree: how many corners these have.

    Raises:
        ParameterError: it is no whole number from 1 to 16, or so many refined faces cannot fit
            into the memory here, or cannot be numbered.
    """
    levels = levels_given(given)
    made, there = children * 4 ** (levels - 1), memory_here()
    needed = made * LEAST_BYTES_PER_FACE
    if there is not None and needed > there:
        sizes = f"{needed / 2**30:,.1f} GiB or more, of the {there / 2**30:,.1f} here"
        raise ParameterError("levels", levels, expected=f"fewer: {made:,} faces take {sizes}")
    if degree * made > LARGEST_INDEX:
        raise ParameterError("levels", levels, expected=f"fewer: {made:,} faces cannot be numbered")
    return levels


def levels_given(given: SupportsIndex) -> int:
    """Return a number of levels as int. Raises ParameterError: no whole number from 1 to 16."""
    if not (is_whole(given) and 1 <= int(given) <= HIGHEST_LEVELS):
        raise ParameterError("levels", given, expected=f"a whole number, 1 … {HIGHEST_LEVELS}")
    return int(given)


def _reference_length(mesh: Mesh, given: float | str, *, measured: bool) -> float | None:
    """Return R; None where it is to be measured only if the report asks for it."""
    # An array compares with a word element by element.
    if isinstance(given, str) and given == "auto":
        if not measured:
            return None
        return measure_reference_length(mesh.vertices, mesh.corners)
    if not (is_number(given) and float(given) > 0):
        raise ParameterError("reference_length", given, expected='"auto" or a number > 0')
    return float(given)


def _threads(given: int | None) -> int:
    if given is None:
        return available_threads()
    if not (is_whole(given) and given >= 1):
        raise ParameterError("threads", given, expected="a whole number, at least 1")
    return int(given)


def _progress(
    children: int,
    levels: int,
    learned_levels: int,
    limit: bool,
    tell: Callable[[int, int], None] | None,
) -> Progress | None:
    if tell is None:
        return None
    if not callable(tell):
        raise ParameterError("progress", tell, expected=PROGRESS)
    return Progress(children, levels, learned_levels, limit, tell)
