"""The symmetries of a star, turns and a mirror: what commutes with them falls into small blocks.

Within a block eigenvalues are simple, and a tangent can only be confused with another eigenvalue of
its own block: so eigenvalues of one block are followed apart from those of the others.
"""

import numpy as np
from jaxtyping import Float

from train.spectra.stars import Star

# An orthonormal basis of an invariant subspace.
Subspace = Float[np.ndarray, "M D"]
# What rounding may take out of a block, of a matrix's largest entry.
ROUNDING = 1e-7


def symmetry_blocks(star: Star, valence: int) -> tuple[Subspace, ...]:
    """Return orthonormal bases, together of the whole space of inner coordinates.

    One for each frequency 0 … k/2 of a vector field around the star, and each of its two parts
    under a mirror: of a frequency between, the parts have one spectrum twice.
    """
    points = star.mesh.vertices[star.inner]
    turn, mirror = _representation(points, _turn(valence)), _representation(points, _MIRROR)
    powers = [np.eye(len(turn))]
    for _ in range(valence - 1):
        powers.append(powers[-1] @ turn)
    blocks: list[Subspace] = []
    for frequency in range(valence // 2 + 1):
        part = (
            sum(
                np.cos(2 * np.pi * frequency * step / valence) * power
                for step, power in enumerate(powers)
            )
            / valence
        )
        if 0 < 2 * frequency < valence:
            part = 2 * part
        for sign in (1, -1):
            projector = part @ (np.eye(len(turn)) + sign * mirror) / 2
            values, vectors = np.linalg.eigh((projector + projector.T) / 2)
            if values[-1] > 1 / 2:
                blocks.append(vectors[:, values > 1 / 2])
    return tuple(blocks)


def keeps_blocks(matrix: Float[np.ndarray, "M M"], blocks: tuple[Subspace, ...]) -> bool:
    """Return whether a matrix maps every block to itself, but for rounding."""
    kept = sum(block @ (block.T @ matrix @ block) @ block.T for block in blocks)
    return bool(np.abs(matrix - kept).max() <= ROUNDING * np.abs(matrix).max())


# The first spoke lies on the x axis.
_MIRROR = np.diag([1.0, -1.0, 1.0])


def _turn(valence: int) -> Float[np.ndarray, "3 3"]:
    angle = 2 * np.pi / valence
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _representation(
    points: Float[np.ndarray, "N 3"], motion: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "M M"]:
    """Return how a motion of the star onto itself acts on the coordinates of its vertices."""
    plane = np.array([1.0, 1.0, 0.0])
    moved = (points * plane) @ motion.T
    apart = np.linalg.norm(moved[:, None] - (points * plane)[None], axis=2)
    permutation = np.zeros((len(points), len(points)))
    permutation[np.argmin(apart, axis=1), np.arange(len(points))] = 1
    return np.kron(permutation, motion)
