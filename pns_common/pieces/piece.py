"""Refine a piece of a mesh with its halo: its own faces as the whole mesh's refinement has them.

The whole's bits depend on its orders: sums around a vertex run over edges in the order in which
these first appear in faces, and stencils start at lower vertices and faces. So a piece keeps its
faces, and the numbers of its vertices, in the whole's order; then everything whose surroundings are
there has the same order too, at all levels. Which that is is checked: see exact.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.arguments import checked_levels
from pns_common.base.blocks import Blocks
from pns_common.base.distinct import first_places
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.fused import fits, kernels_available
from pns_common.fused.known import kernels_know
from pns_common.levels.refined_levels import check_coordinates
from pns_common.levels.step import AddedStep
from pns_common.mesh import check_faces
from pns_common.pieces.exact import guarded_exact, shrunk
from pns_common.pieces.halo import ThinHaloError, lines_reach, reach
from pns_common.pieces.steps import Links, Step, steps_by_arrays, steps_by_kernels
from pns_common.pieces.tally import LevelTally
from pns_common.pieces.tally_of_step import tally_of
from pns_common.schemes import Scheme


@dataclass(frozen=True, eq=False)
class Piece:
    """Some faces of a mesh, in its order, and vertices numbered in its order.

    Attributes:
        points: (V, 3).
        faces: (F, 3) rows of ``points``.
        own: the faces to be refined; the others are the halo.
        whole: vertices whose faces are all here.
        creases: edges of the piece to keep sharp, named in its numbers or to be found.

    Raises:
        MeshError: a face has an index out of range.
    """

    points: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    own: Bool[np.ndarray, " F"]
    whole: Bool[np.ndarray, " V"]
    creases: Creases = NO_CREASES

    def __post_init__(self) -> None:
        # Kernels read where an index says, and know these types alone; no copy of what is so.
        check_faces(self.faces, len(self.points))
        for name, dtype in (("points", np.float64), ("faces", np.int64)):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=dtype))


@dataclass(frozen=True, eq=False)
class RefinedPiece:
    """A refined piece, halo included: only what is of its own faces has the whole's bits.

    Attributes:
        points: (W, 3): the piece's vertices, then those of each level's edges.
        faces: (F 4^L, 3) rows of ``points``; face f became F 4^L rows from 4^L f on.
        openers: of each level the face that an edge is first in, counted in faces of the control
            piece, in the order of the edges.
        own_vertices: the vertices that are this piece's to write, and no other's.
        tallies: of each level.
        multi_fan_vertices: own vertices of the control mesh whose faces form more than one fan.
    """

    points: Float[np.ndarray, "W 3"]
    faces: Int[np.ndarray, "C 3"]
    openers: list[Int[np.ndarray, "..."]]
    own_vertices: Bool[np.ndarray, " W"]
    tallies: list[LevelTally]
    multi_fan_vertices: int


def refine_piece(
    piece: Piece, scheme: Scheme, levels: int, length: float, blocks: Blocks
) -> RefinedPiece:
    """Refine a piece; ``length`` is R of the whole mesh, and the scheme is fitted to that.

    Raises:
        ThinHaloError: the halo is too thin to be sure of all own faces.
        ParameterError: levels out of 1 … 16, a crease is no edge of the piece, or the scheme is not
            known.
        ModelError: the network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large.
    """
    levels = checked_levels(levels)
    own, rim = piece.own, ~piece.whole
    exact: Bool[np.ndarray, " F"] = np.ones(len(piece.faces), dtype=bool)
    own_vertices = np.zeros(0, dtype=bool)
    openers: list[Int[np.ndarray, "..."]] = []
    tallies: list[LevelTally] = []
    multi_fan_vertices = 0
    step = None
    for level, step in zip(
        range(levels), steps_of(piece, scheme, levels, length, blocks), strict=False
    ):
        links = step.links
        if level == 0:
            own_vertices = first_at_own(links, own)
            for _ in range(lines_reach(piece.creases)):
                exact = shrunk(exact, links.faces, rim)
            assert links.multi_fan_vertices is not None
            multi_fan_vertices = int((links.multi_fan_vertices & own_vertices).sum())
        own_edges = own[links.first // 3]
        for _ in range(reach(scheme, level)):
            exact = shrunk(exact, links.faces, rim)
        exact = np.repeat(exact, 4)
        if scheme.guard is not None and scheme.acts_at(level) and not exact.all():
            asked = _asked(step.placed)
            if asked is not None and step.loop is not None:
                angle = scheme.guard.angle
                exact = guarded_exact(exact, step.children, step.loop, asked, angle)
        _check_own(level, links, own, own_edges, exact)
        own_vertices = np.concatenate([own_vertices, own_edges])
        check_coordinates(float(np.abs(step.points[own_vertices]).max(initial=0)))
        tallies.append(tally_of(step, own, own_vertices, own_edges))
        openers.append(links.first // (3 * 4**level))
        own = np.repeat(own, 4)
        rim = np.zeros(len(step.points), dtype=bool)
    assert step is not None  # levels ≥ 1
    return RefinedPiece(
        step.points, step.children, openers, own_vertices, tallies, multi_fan_vertices
    )


def steps_of(
    piece: Piece, scheme: Scheme, levels: int, length: float, blocks: Blocks
) -> Iterator[Step]:
    """Return the steps of a piece, one after the other as they are asked for."""
    known = scheme.learned_levels == 0 or (length > 0 and kernels_know(scheme))
    fused = known and kernels_available() and fits(len(piece.points), len(piece.faces), levels)
    steps = steps_by_kernels if fused else steps_by_arrays
    return steps(piece.points, piece.faces, piece.creases, scheme, length, blocks)


def first_at_own(links: Links, own: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " V"]:
    """Return the vertices that first appear in an own face.

    Of vertices around own faces alone that is sure.
    """
    first = first_places(links.faces.reshape(-1), links.vertex_count)
    return (first >= 0) & own[first // 3]


def _check_own(
    level: int,
    links: Links,
    own: Bool[np.ndarray, " F"],
    own_edges: Bool[np.ndarray, " E"],
    exact: Bool[np.ndarray, " C"],
) -> None:
    """Check that own faces' children are exact, and those that they meet across own edges.

    Raises:
        ThinHaloError: some are not.
    """
    needed = own.copy()
    across = links.second[own_edges]
    needed[across[across >= 0] // 3] = True
    lacking = np.repeat(needed, 4) & ~exact
    if lacking.any():
        raise ThinHaloError(level, int(lacking.sum()))


def _asked(placed: AddedStep | None) -> Float[np.ndarray, "W 3"] | None:
    """Return what was to be added before the guard scaled it; not finite where it took all."""
    if placed is None or placed.guard is None:
        return None
    added = [
        np.zeros((len(rule.ratio), 3)) if rule.displacement is None else rule.displacement
        for rule in (placed.vertices, placed.edges)
    ]
    scale = placed.guard[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        # Scales are powers of 2: dividing by them gives back what was there.
        return np.where(scale > 0, np.concatenate(added) / scale, np.inf)
