"""A control mesh of any size, written row by row."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

# Rows whose pages are held at a time.
ROWS = 64


def torus(folder: Path, faces: int) -> None:
    """Write a bumpy torus of about so many faces as a folder of arrays, memory-mapped."""
    from service.scale.large.arrays import let_go

    side = side_of(faces)
    folder.mkdir(parents=True)
    shape = (side * side, 3), (2 * side * side, 3)
    kinds = np.float64, np.int32
    names = "positions.npy", "faces.npy"
    points, corners = (
        np.lib.format.open_memmap(folder / name, "w+", kind, rows)
        for name, kind, rows in zip(names, kinds, shape, strict=True)
    )
    v = np.arange(side)
    b = v * (2 * np.pi / side)
    for u in range(side):
        a = u * (2 * np.pi / side)
        r = 0.35 * (1 + 0.08 * np.sin(9 * a) * np.cos(7 * b) + 0.02 * np.sin(61 * a + 3 * b))
        ring = 1 + r * np.cos(b)
        rows = slice(u * side, (u + 1) * side)
        points[rows] = np.stack([ring * np.cos(a), ring * np.sin(a), r * np.sin(b)], axis=1)
        here, across = u * side + v, (u + 1) % side * side + v
        on, diagonal = u * side + (v + 1) % side, (u + 1) % side * side + (v + 1) % side
        pair = np.stack([here, across, diagonal, here, diagonal, on], axis=1)
        corners[2 * rows.start : 2 * rows.stop] = pair.reshape(-1, 3)
        if u % ROWS == 0:
            let_go(points, corners)


def side_of(faces: int) -> int:
    """Return how many vertices a torus of about so many faces has around, either way."""
    return max(3, round(math.sqrt(faces / 2)))


def bytes_of(faces: int) -> int:
    """Return what the arrays of such a torus take."""
    vertices = side_of(faces) ** 2
    return 24 * vertices + 12 * 2 * vertices
