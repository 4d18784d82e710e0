"""Refine polygons over Catmull–Clark's scheme until they are near enough, or are so many."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Integer

from pns_common.adaptive.polygons import PolygonStart
from pns_common.adaptive.quad_certificate import QUAD
from pns_common.adaptive.refine import AdaptiveRefinement, start_of, written
from pns_common.adaptive.tree import Goal
from pns_common.errors import MeshError
from pns_common.mesh.creases import Creases
from pns_common.mesh.topology import following
from pns_common.operator.level import Level
from pns_common.operator.scheme import Scheme
from pns_common.progress import Shares
from pns_common.refined import Step

# Where the corners of a quad are in it.
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PolygonRefinement(AdaptiveRefinement):
    """A refinement of polygons with faces of several levels.

    ``codes`` number control faces at level 0, and from level 1 on quads: that of the control
    mesh's corner h is h, and those of quad c are 4 c … 4 c + 3.
    """

    @cached_property
    def face_parents(self) -> Integer[np.ndarray, " F"]:
        """The control face that each face is a part of."""
        corners = self.codes >> (2 * np.maximum(self.face_levels - 1, 0))
        deeper = self.face_levels > 0
        made = self.codes.copy()
        made[deeper] = self.control.topology.face_of(corners[deeper])
        return made

    @cached_property
    def weights(self) -> Float[np.ndarray, "F 3 3"]:
        """Raise: a polygon's corners may be made of any number of corners."""
        raise MeshError("polygons have places in quads: use quads or at_corners", element="faces")

    @cached_property
    def quads(self) -> tuple[Integer[np.ndarray, " H"], Float[np.ndarray, "H 4"]]:
        """The quad of the first level that each corner is in, and weights of its corners there.

        The quad of the control mesh's corner h has h, the middle of the side that leaves it, that
        of its face, and the middle of the side that enters it. Weights are whole multiples of
        4^-levels, and sum to 1.
        """
        counts, mesh = np.diff(self.mesh.offsets), self.control.topology
        levels, codes = self.face_levels.repeat(counts), self.codes.repeat(counts)
        side, along = self.at.astype(np.int64), (self.at % 1)[:, None]
        place = CORNERS[side % QUAD] * (1 - along) + CORNERS[(side + 1) % QUAD] * along
        for level in range(int(levels.max(initial=0)) - 1):
            rows = np.flatnonzero(levels > level + 1)
            x, y = place[rows].T / 2
            turned = np.stack([[x, y], [1 - y, x], [1 - x, 1 - y], [y, 1 - x]])
            place[rows] = turned[codes[rows] % QUAD, :, np.arange(len(rows))]
            codes[rows] //= QUAD
        rows = np.flatnonzero(levels == 0)
        begin, half = mesh.offsets[codes[rows]] + side[rows], along[rows, 0]
        second = half > 1 / 2
        codes[rows] = np.where(second, following(mesh.offsets)[begin], begin)
        place[rows, 0] = np.where(second, 0.0, 2 * half)
        place[rows, 1] = np.where(second, 2 - 2 * half, 0.0)
        x, y = place.T
        weights = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], axis=1)
        return codes, weights

    @cached_property
    def nearest_corners(self) -> Integer[np.ndarray, " H"]:
        """The nearest corner of the control mesh in its quad, of each corner."""
        return self.quads[0]

    @cached_property
    def edge_parents(self) -> Integer[np.ndarray, " H"]:
        """The control edge that the side from each corner on lies on; −1: inside of a face."""
        mesh, (rows, weights) = self.control.topology, self.quads
        edges, before = mesh.corner_edges.astype(np.int64), following(mesh.offsets)
        entering = np.empty_like(edges)
        entering[before] = edges
        leaves, enters = weights[:, 2:].sum(axis=1) == 0, weights[:, 1:3].sum(axis=1) == 0
        own = np.where([leaves, enters], [edges[rows], entering[rows]], -1)
        other = own[:, following(self.mesh.offsets)]
        made = np.full(len(rows), -1)
        for one in own:
            for two in other:
                made = np.where((one == two) & (one >= 0), one, made)
        return made

    def at_corners(self, values: Float[np.ndarray, "H K"]) -> Float[np.ndarray, "G K"]:
        """Return values of the control mesh's corners at corners of faces, face after face.

        They are linear along sides of control faces, and bilinear in the quads of the first level.
        """
        mesh, own = self.control.topology, np.asarray(values, dtype=np.float64)
        middles = np.add.reduceat(own, mesh.offsets[:-1]) / np.diff(mesh.offsets)[:, None]
        sides, after = np.empty_like(own), following(mesh.offsets)
        leaving = (own + own[after]) / 2
        sides[after] = leaving
        inside = middles[mesh.face_of(np.arange(len(own)))]
        rows, weights = self.quads
        parts = zip((own, leaving, inside, sides), weights.T, strict=True)
        return sum((weight[:, None] * of[rows] for of, weight in parts), np.zeros(()))


def refine_polygons(
    level: Level,
    first: Step,
    scheme: Scheme,
    creases: Creases,
    goal: Goal,
    deepest: int,
    shares: Shares,
) -> PolygonRefinement:
    """Refine a mesh of polygons to a goal; arguments as of ``refine_to_goal``."""
    start = start_of(PolygonStart, level, first, scheme, creases, goal, deepest, shares)
    return written(PolygonRefinement, start, shares, level, first, scheme)
