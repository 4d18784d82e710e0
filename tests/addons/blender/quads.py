"""Meshes of quads as snapshots, for what needs no Blender."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from addons.blender.pns_refine.refining.snapshot import Layer, Snapshot

CUBE_POINTS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_SIDES = np.array(
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)


def cube(crease_sharpness: float | np.ndarray = 0.0, layers: tuple[Layer, ...] = ()) -> Snapshot:
    """A cube of six quads, whose edges are all this sharp."""
    return snapshot(CUBE_POINTS, CUBE_SIDES, crease_sharpness, layers)


def grid(cells: int, layers: tuple[Layer, ...] = ()) -> Snapshot:
    """A hilly square of so many quads a side."""
    side = cells + 1
    across, along = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    points = np.stack([across, along, 0.2 * np.sin(3 * across) * np.cos(2 * along)], axis=-1)
    first = (np.arange(cells)[:, None] * side + np.arange(cells)).reshape(-1)
    quads = np.stack([first, first + side, first + side + 1, first + 1], axis=1)
    return snapshot(points.reshape(-1, 3), quads, 0.0, layers)


def cut(shape: Snapshot) -> Snapshot:
    """The same mesh, whose polygons are the triangles."""
    count = len(shape.triangles)
    starts, corners = 3 * np.arange(count + 1), np.arange(3 * count).reshape(-1, 3)
    return replace(shape, corners=corners, polygons=np.arange(count), polygon_corners=starts)


def snapshot(
    points: np.ndarray,
    quads: np.ndarray,
    crease_sharpness: float | np.ndarray,
    layers: tuple[Layer, ...],
) -> Snapshot:
    """Return what is read of these quads, each cut along the diagonal from its first corner."""
    first = 4 * np.arange(len(quads))[:, None]
    halves = first[:, None] + np.array([[0, 1, 2], [0, 2, 3]])
    corners = halves.reshape(-1, 3)
    sides = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0)
    return Snapshot(
        points=points,
        triangles=quads.reshape(-1)[corners],
        corners=corners,
        polygons=np.repeat(np.arange(len(quads)), 2),
        polygon_corners=4 * np.arange(len(quads) + 1),
        edges=edges,
        crease_sharpness=np.broadcast_to(np.asarray(crease_sharpness, float), len(edges)).copy(),
        vertex_sharpness=np.zeros(len(points)),
        groups=np.zeros((len(points), 0)),
        offsets=np.zeros((0, len(points), 3)),
        layers=layers,
    )
