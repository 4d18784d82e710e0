"""A base scheme's masks alone, on any columns: what follows vertices without being a position.

Skin weights and morph deltas go through the masks that move the vertices; the learned correction
is no part of it, so the result is linear in the columns. ``subdivision_matrix`` is that linear map,
with which other code can trace each refined vertex to the control vertices that it is made of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Integer, Real

from pns_common.base_scheme import BaseScheme
from pns_common.creases import NO_CREASES, Creases
from pns_common.errors import MeshError, ParameterError
from pns_common.kernels import columns as kernels
from pns_common.limit import limit_positions
from pns_common.mesh import as_polygons
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from pns_common.topology import Topology, build_topology

# Colours that go through the masks at once: two columns each.
TOGETHER = 12


def level_topologies(
    faces: Any,
    vertex_count: int,
    levels: int,
    creases: Creases = NO_CREASES,
    base: BaseScheme = LOOP,
    blocks: Blocks | None = None,
) -> list[Topology]:
    """Return the topologies of the meshes that ``levels`` steps refine, control mesh first.

    The creases are those that are named: without positions none is found by its angle. Faces are
    as ``Mesh`` takes them, or none.

    Raises:
        MeshError: wrong shape or type of the faces, an index out of range, or polygons for a scheme
            of triangles.
        ParameterError: a crease is no edge.
    """
    corners, offsets = as_polygons(faces, vertex_count)
    blocks = blocks or Blocks()
    topologies = [build_topology((corners, offsets), vertex_count, blocks)]
    if not (topologies[0].triangles or base.polygons):
        raise MeshError("polygons, expected triangles", element="faces")
    if creases.named is not None and creases.sharp_at(0):
        topologies[0] = topologies[0].with_creases(topologies[0].rows_of(creases.named))
    for depth in range(1, levels):
        topologies.append(base.split(topologies[-1], blocks, inherit=creases.sharp_at(depth)))
    return topologies[:levels]


def refine_columns(
    columns: Real[np.ndarray, "V K"],
    topologies: Sequence[Topology],
    base: BaseScheme = LOOP,
    *,
    limit: bool = False,
    blocks: Blocks | None = None,
) -> Float[np.ndarray, "W K"]:
    """Refine columns by a base scheme's masks, level by level.

    Args:
        columns: a row for each control vertex.
        topologies: those of the meshes that are refined, control mesh first: of
            ``level_topologies``, or ``Refinement.topologies``.
        base: the scheme.
        limit: apply the limit mask at the end.
        blocks: how the work is shared.

    Raises:
        ParameterError: there is not one row for each vertex.
    """
    return ColumnRefinement(topologies, base, limit, blocks or Blocks())(columns)


@dataclass(frozen=True, eq=False)
class ColumnRefinement:
    """``refine_columns`` for many calls over one mesh.

    Attributes:
        topologies: those of the meshes that are refined, control mesh first; one at least.
        base: the scheme.
        limit: whether the limit mask is applied at the end.
        blocks: how the work is shared.
    """

    topologies: Sequence[Topology]
    base: BaseScheme = LOOP
    limit: bool = False
    blocks: Blocks = field(default_factory=Blocks)

    @cached_property
    def last(self) -> Topology:
        """The topology of the refined mesh."""
        return self.base.split(self.topologies[-1], self.blocks)

    @property
    def count(self) -> int:
        """How many refined vertices there are."""
        return self.last.vertex_count

    def __call__(self, columns: Real[np.ndarray, "V K"]) -> Float[np.ndarray, "W K"]:
        """Refine columns. Raises ParameterError unless there is one row for each vertex."""
        count = self.topologies[0].vertex_count
        if columns.ndim != 2 or len(columns) != count:
            expected = f"({count}, K), a row for each vertex"
            raise ParameterError("columns.shape", columns.shape, expected=expected)
        values = np.asarray(columns, dtype=np.float64)
        for topology in self.topologies:
            values = self.base.place(values, topology, self.blocks)
        return limit_positions(values, self.last, self.blocks, self.base) if self.limit else values


@dataclass(frozen=True, eq=False)
class SubdivisionMatrix:
    """The map S from control vertices to refined ones, in coordinates: S[rows, columns] = weights.

    With scipy: ``scipy.sparse.coo_array((s.weights, (s.rows, s.columns)), shape=s.shape)``. The
    entries are sorted by row, then by column; none is twice. Weights are > 0 and sum to 1 in a row,
    so the columns of a row are the parents of a refined vertex.
    """

    rows: Integer[np.ndarray, " N"]
    columns: Integer[np.ndarray, " N"]
    weights: Float[np.ndarray, " N"]
    shape: tuple[int, int]

    @property
    def starts(self) -> Integer[np.ndarray, " R"]:
        """Where the entries of each row begin, and after the last row where they end."""
        return np.searchsorted(self.rows, np.arange(self.shape[0] + 1))


def subdivision_matrix(
    topologies: Sequence[Topology], base: BaseScheme = LOOP, blocks: Blocks | None = None
) -> SubdivisionMatrix:
    """Return S with S @ columns = ``refine_columns(columns, topologies, base)``, to rounding.

    The masks are read from ``base.place`` itself: from columns of ones at vertices that no row has
    two of, of which a mesh needs a few more than its largest valence.
    """
    blocks = blocks or Blocks()
    made = _level_matrix(topologies[0], base, blocks)
    for topology in topologies[1:]:
        made = _product(_level_matrix(topology, base, blocks), made)
    return made


def _level_matrix(topology: Topology, base: BaseScheme, blocks: Blocks) -> SubdivisionMatrix:
    """Return S of one level, whose rows read the corners of the faces around one vertex."""
    count = topology.vertex_count
    order = np.argsort(topology.corners, kind="stable")
    starts = np.searchsorted(topology.corners[order], np.arange(count + 1))
    faces = topology.face_of_corner if len(topology.face_of_corner) else np.arange(len(order)) // 3
    colour = np.full(count, -1, dtype=np.int64)
    read = topology.corners, topology.offsets, faces[order], starts
    colours = kernels.colour_stars(*read, np.full(count + 1, -1, dtype=np.int64), colour)
    # One column of ones, and one of the vertices' numbers, which tells whose weight it is.
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    named, size = np.arange(1, count + 1, dtype=np.float64), 0
    for first in range(0, colours, TOGETHER):
        here = colour[:, None] == np.arange(first, min(first + TOGETHER, colours))
        placed = base.place(np.hstack([here, here * named[:, None]]), topology, blocks)
        size, (ones, numbers) = len(placed), np.split(placed, 2, axis=1)
        rows, which = np.nonzero(ones > 0)
        weights = ones[rows, which]
        parts.append((rows, np.rint(numbers[rows, which] / weights).astype(np.int64) - 1, weights))
    rows, columns, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(rows * count + columns)
    return SubdivisionMatrix(rows[order], columns[order], weights[order], (size, count))


def _product(later: SubdivisionMatrix, earlier: SubdivisionMatrix) -> SubdivisionMatrix:
    shape = (later.shape[0], earlier.shape[1])
    most = int(np.diff(earlier.starts)[later.columns].sum())
    starts, columns = np.empty(shape[0] + 1, dtype=np.int64), np.empty(most, dtype=np.int64)
    weights = np.empty(most)
    left = later.starts, later.columns, later.weights
    right = earlier.starts, earlier.columns, earlier.weights
    count = kernels.multiply_rows(*left, *right, np.zeros(shape[1]), starts, columns, weights)
    rows = np.repeat(np.arange(shape[0]), np.diff(starts))
    return SubdivisionMatrix(rows, columns[:count].copy(), weights[:count].copy(), shape)
