"""Meshes of any size for benchmarks: with ridges, numbered as an exporter would or at random."""

from __future__ import annotations

import numpy as np

from pns_common import Mesh
from pns_common.base.blocks import WHOLE
from pns_common.geometry.corner_normals import angle_weighted_normals
from service.meshfiles.indexed_triangles import IndexedTriangles


def torus(faces: int) -> Mesh:
    """Make a torus with ridges along its tube, of about so many faces."""
    columns, rows = _torus_size(faces)
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


def unrolled_torus(faces: int) -> tuple[IndexedTriangles, np.ndarray]:
    """Make the same as exporters write it, cut open where its texture begins; and its normals."""
    whole, (columns, rows) = torus(faces), _torus_size(faces)
    u, v = np.divmod(np.arange((columns + 1) * (rows + 1)), rows + 1)
    place = u % columns * rows + v % rows
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    here, width = i * (rows + 1) + j, rows + 1
    quads = [
        np.stack([here, here + width, here + width + 1], axis=-1),
        np.stack([here, here + width + 1, here + 1], axis=-1),
    ]
    triangles = np.stack(quads, axis=-2).reshape(-1, 3)
    uv = np.stack([u / columns, v / rows], axis=1)
    mesh = whole.vertices, whole.faces
    normals = angle_weighted_normals(*mesh, whole.faces, len(whole.vertices), WHOLE)
    return IndexedTriangles(whole.vertices[place], triangles, uv), normals[place]


def _torus_size(faces: int) -> tuple[int, int]:
    """Return how many points lie around a torus, and around its tube."""
    columns = round((faces / 2) ** 0.5 * 2**0.5)
    return columns, max(3, round(faces / 2 / columns))


def patch(faces: int) -> Mesh:
    """Make an open patch over [−1, 1]² with ridges, of about so many faces."""
    n = round((faces / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    z = 0.2 * np.exp(-30 * (x + 0.3 * np.sin(2 * y)) ** 2) + 0.05 * np.sin(5 * y)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    v = i * n + j
    pairs = [np.stack([v, v + n, v + n + 1], axis=-1), np.stack([v, v + n + 1, v + 1], axis=-1)]
    triangles = np.stack(pairs, axis=-2).reshape(-1, 3)
    return Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), triangles)


def shuffled(mesh: Mesh, seed: int = 0) -> Mesh:
    """Return the same mesh, vertices and faces in random order: the worst case for caches."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[order] = mesh.vertices
    return Mesh(vertices, order[mesh.faces][rng.permutation(len(mesh.faces))])


ORDERS = {
    "closed": torus,
    "open": patch,
    "shuffled": lambda faces: shuffled(torus(faces)),
}
