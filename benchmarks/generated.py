"""Meshes of any size for benchmarks: closed, with ridges, numbered as an exporter would."""

from __future__ import annotations

import numpy as np

from pns_common import Mesh


def torus(faces: int) -> Mesh:
    """A torus with ridges along its tube, of about so many faces."""
    columns = round((faces / 2) ** 0.5 * 2**0.5)
    rows = max(3, round(faces / 2 / columns))
    u, v = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    around, along = 2 * np.pi * u / columns, 2 * np.pi * v / rows
    tube = 0.35 * (1 + 0.15 * np.exp(-8 * np.sin(4 * around) ** 2))
    radius = 1 + tube * np.cos(along)
    points = np.stack(
        [radius * np.cos(around), radius * np.sin(around), tube * np.sin(along)], axis=-1
    )
    here, right = u * rows + v, (u + 1) % columns * rows + v
    up, beyond = u * rows + (v + 1) % rows, (u + 1) % columns * rows + (v + 1) % rows
    quads = [np.stack([here, right, beyond], axis=-1), np.stack([here, beyond, up], axis=-1)]
    return Mesh(points.reshape(-1, 3), np.stack(quads, axis=-2).reshape(-1, 3))
