"""The subdivision matrix: the linear map from control vertices to refined ones.

It traces each refined vertex to the control vertices that it is made of. ``Scheme.matrix`` gives it
as a sparse array of scipy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import matrix as kernels
from pns_common.mesh.rows import ranges
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks
from pns_common.schemes.base_scheme import BaseScheme

# Colours that go through the masks at once: two columns each.
TOGETHER = 12

# Columns of vertices → columns of new vertices, or of the same at their limits.
Place = Callable[[np.ndarray, Topology, Blocks], np.ndarray]


@dataclass(frozen=True, eq=False)
class SubdivisionMatrix:
    """The map S from control vertices to refined ones, in coordinates: S[rows, columns] = weights.

    The entries are sorted by row, then by column; none is twice. Weights are > 0 and sum to 1 in a
    row, so the columns of a row are the parents of a refined vertex.
    """

    rows: Integer[np.ndarray, " N"]
    columns: Integer[np.ndarray, " N"]
    weights: Float[np.ndarray, " N"]
    shape: tuple[int, int]

    def take(self, rows: Integer[np.ndarray, " M"]) -> SubdivisionMatrix:
        """Return some of the rows."""
        starts = self.starts
        counts = np.diff(starts)[rows]
        entries = ranges(starts[rows], counts)
        own, shape = np.repeat(np.arange(len(rows)), counts), (len(rows), self.shape[1])
        return SubdivisionMatrix(own, self.columns[entries], self.weights[entries], shape)

    def unmoved(self, still: Bool[np.ndarray, " C"]) -> SubdivisionMatrix:
        """Return the map whose first rows, where ``still``, are those of the identity."""
        own = np.flatnonzero(still)
        left = ~np.isin(self.rows, own)
        parts = (self.rows, own), (self.columns, own), (self.weights, np.ones(len(own)))
        rows, columns, weights = (np.concatenate([a[left], b]) for a, b in parts)
        order = np.argsort(rows, kind="stable")
        return SubdivisionMatrix(rows[order], columns[order], weights[order], self.shape)

    @property
    def starts(self) -> Integer[np.ndarray, " R"]:
        """Start of each row's entries, and the end of the last row's."""
        return np.searchsorted(self.rows, np.arange(self.shape[0] + 1))


def subdivision_matrix(
    topologies: Sequence[Topology],
    base: BaseScheme,
    at_last: Place | None = None,
) -> SubdivisionMatrix:
    """Return S with S @ values = ``columns.refine_columns(values, topologies, base)``, to rounding.

    The masks are read from ``base.place`` itself: from columns of ones at vertices that no row has
    two of, of which a mesh needs a few more than its largest valence. `at_last` are masks to apply
    to the refined mesh: ``limit_positions``.
    """
    blocks = Blocks()
    made = mask_matrix(topologies[0], base.place, blocks)
    for topology in topologies[1:]:
        made = product(mask_matrix(topology, base.place, blocks), made)
    if at_last is not None:
        made = product(mask_matrix(base.split(topologies[-1], blocks), at_last, blocks), made)
    return made


def mask_matrix(topology: Topology, place: Place, blocks: Blocks) -> SubdivisionMatrix:
    """Return the matrix of masks whose rows read the corners of the faces around one vertex."""
    count = topology.vertex_count
    order = np.argsort(topology.corners, kind="stable")
    starts = np.searchsorted(topology.corners[order], np.arange(count + 1))
    faces = topology.face_of(order)
    colour = np.full(count, -1, dtype=np.int64)
    taken = np.full(count + 1, -1, dtype=np.int64)
    colours = kernels.colour_stars(topology.connectivity, faces, starts, taken, colour)
    # One column of ones, and one of the vertices' numbers, which tells whose weight it is.
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    named, size = np.arange(1, count + 1, dtype=np.float64), 0
    for first in range(0, colours, TOGETHER):
        here = colour[:, None] == np.arange(first, min(first + TOGETHER, colours))
        placed = place(np.hstack([here, here * named[:, None]]), topology, blocks)
        size, (ones, numbers) = len(placed), np.split(placed, 2, axis=1)
        rows, which = np.nonzero(ones > 0)
        weights = ones[rows, which]
        parts.append((rows, np.rint(numbers[rows, which] / weights).astype(np.int64) - 1, weights))
    rows, columns, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(rows * count + columns)
    return SubdivisionMatrix(rows[order], columns[order], weights[order], (size, count))


def product(later: SubdivisionMatrix, earlier: SubdivisionMatrix) -> SubdivisionMatrix:
    """Return the map that applies one map after another."""
    shape = (later.shape[0], earlier.shape[1])
    most = int(np.diff(earlier.starts)[later.columns].sum())
    starts, columns = np.empty(shape[0] + 1, dtype=np.int64), np.empty(most, dtype=np.int64)
    weights = np.empty(most)
    left = later.starts, later.columns, later.weights
    right = earlier.starts, earlier.columns, earlier.weights
    count = kernels.multiply_rows(*left, *right, np.zeros(shape[1]), starts, columns, weights)
    rows = np.repeat(np.arange(shape[0]), np.diff(starts))
    return SubdivisionMatrix(rows, columns[:count].copy(), weights[:count].copy(), shape)
