"""Primitive modes that make triangles (glTF 2.0 §3.7.2.1): how many, and from which corners."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from ...errors import GltfError

TRIANGLES, STRIP, FAN = 4, 5, 6
SURFACES = (TRIANGLES, STRIP, FAN)


def triangle_count(corners: int, mode: int, pointer: str) -> int:
    """Return how many triangles a number of corners makes.

    Raises:
        GltfError: corners that make no whole triangles.
    """
    if mode == TRIANGLES:
        if corners % 3:
            raise GltfError(f"{corners} corners are no whole triangles", pointer=pointer)
        return corners // 3
    if corners < 3:
        raise GltfError(f"{corners} corners make no triangle", pointer=pointer)
    return corners - 2


def triangles(corners: Int[np.ndarray, " C"], mode: int) -> Int[np.ndarray, "F 3"]:
    """Return the corners of each triangle, in glTF's order and with its first corner."""
    if mode == TRIANGLES:
        return corners.reshape(-1, 3)
    step = np.arange(len(corners) - 2)
    if mode == FAN:
        places = np.stack([step + 1, step + 2, np.zeros_like(step)], axis=1)
    else:
        odd = step % 2
        places = np.stack([step, step + 1 + odd, step + 2 - odd], axis=1)
    return corners[places]
