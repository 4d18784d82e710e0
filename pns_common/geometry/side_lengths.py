"""How long the sides of a mesh's faces are, and how evenly: what tells who made it.

Simplification that follows an error leaves small faces where a surface bends and large ones where
it does not, and its vertices beside the surface. What samples a surface, meshes it anew or gathers
its vertices in cells leaves faces of one size, and vertices on it.

Sums are taken block by block, one after the other in the order of the faces, so that they have the
same bits wherever they are made.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.arrays import norm

# Faces of a block: part of the result, as the order of its sums.
BLOCK_FACES = 4096


@dataclass(frozen=True)
class SideLengths:
    """Sums over the sides of some faces: one between two faces counts twice.

    Attributes:
        faces: how many.
        total, squares: of the lengths, and of their squares.
    """

    faces: int = 0
    total: float = 0.0
    squares: float = 0.0

    @property
    def variation(self) -> float:
        """Standard deviation over mean: 0 where all are of one length; infinite without any."""
        if not self.total > 0:
            return math.inf
        mean = self.total / (3 * self.faces)
        return math.sqrt(max(self.squares / (3 * self.faces) - mean**2, 0.0)) / mean

    def with_blocks(self, faces: int, sums: Float[np.ndarray, "B 2"]) -> SideLengths:
        """Add the sums of further blocks, of so many faces in all, one after the other."""
        before = np.array([[self.total, self.squares]])
        total, squares = np.cumsum(np.concatenate([before, sums]), axis=0)[-1]
        return SideLengths(self.faces + faces, float(total), float(squares))

    def with_faces(
        self, points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
    ) -> SideLengths:
        """Add further faces; those before must be whole blocks."""
        starts = range(0, len(faces), BLOCK_FACES)
        blocks = [_sums(points, faces[start : start + BLOCK_FACES]) for start in starts]
        return self.with_blocks(len(faces), np.array(blocks).reshape(-1, 2))


def measure_sides(points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> SideLengths:
    """Measure the sides of a mesh's faces."""
    return SideLengths().with_faces(points, faces)


def _sums(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, " 2"]:
    """Return the sums of a block's lengths and squares, side by side: (a, b), (b, c), (c, a)."""
    corners = np.asarray(points[faces], dtype=np.float64)
    lengths = norm((np.roll(corners, -1, axis=1) - corners).reshape(-1, 3))
    return np.cumsum(np.stack([lengths, lengths * lengths], axis=1), axis=0)[-1]
