"""Meshes of any size for benchmarks: with ridges, numbered as an exporter would or at random."""

from __future__ import annotations

import numpy as np

from pns_common import Mesh
from pns_common.mesh.normals import angle_weighted_normals
from pns_common.parallel import Blocks
from service.meshfiles.mesh_file import MeshFile, of_triangles


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


def quads(faces: int) -> Mesh:
    """Make the torus of quads that are not cut in two, of about so many faces."""
    whole = torus(2 * faces)
    # Triangles (a, b, c), (a, c, d) of each quad follow one another.
    pairs = whole.faces.reshape(-1, 6)
    return Mesh(whole.vertices, pairs[:, [0, 1, 2, 5]])


def unrolled_torus(faces: int) -> MeshFile:
    """Make a torus with normals as exporters write it, cut open where its texture begins."""
    whole, (columns, rows) = torus(faces), _torus_size(faces)
    u, v = np.divmod(np.arange((columns + 1) * (rows + 1)), rows + 1)
    place = u % columns * rows + v % rows
    triangles = _cut_quads(columns, rows)
    uv = np.stack([u / columns, v / rows], axis=1)
    mesh = whole.vertices, whole.faces
    normals = angle_weighted_normals(*mesh, whole.faces, len(whole.vertices), Blocks())
    return of_triangles(whole.vertices[place], triangles, uv, normals[place])


def _torus_size(faces: int) -> tuple[int, int]:
    """Return how many points lie around a torus, and around its tube."""
    columns = round((faces / 2) ** 0.5 * 2**0.5)
    return columns, max(3, round(faces / 2 / columns))


def patch(faces: int, bent: float = 1.0) -> Mesh:
    """Make an open patch over [−1, 1]² with ridges, of about so many faces.

    A share of it is ``bent``; the rest lies in one plane.
    """
    n = round((faces / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    z = 0.2 * np.exp(-30 * (x + 0.3 * np.sin(2 * y)) ** 2) + 0.05 * np.sin(5 * y)
    if bent < 1:
        z = z * np.clip(10 * (2 * bent - 1 - x), 0, 1)
    return Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), _cut_quads(n - 1, n - 1))


def _cut_quads(columns: int, rows: int) -> np.ndarray:
    """Return the triangles of a sheet of so many quads, each cut in two: (2 columns rows, 3)."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    here, width = i * (rows + 1) + j, rows + 1
    pairs = [
        np.stack([here, here + width, here + width + 1], axis=-1),
        np.stack([here, here + width + 1, here + 1], axis=-1),
    ]
    return np.stack(pairs, axis=-2).reshape(-1, 3)


def parts(faces: int) -> Mesh:
    """Make boxes of about 768 faces each whose sides are waves, of about so many faces in all.

    An edge in twelve lies on a crease line.
    """
    box = _wavy_box(8)
    count = max(1, round(faces / len(box.faces)))
    number = np.arange(count)
    places = 3.0 * np.stack([number % 20, number // 20, 0 * number], axis=1)
    points = (box.vertices + places[:, None]).reshape(-1, 3)
    triangles = box.faces + len(box.vertices) * number[:, None, None]
    return Mesh(points, triangles.reshape(-1, 3))


def _wavy_box(cells: int) -> Mesh:
    """Make the surface of [−1, 1]³ as so many quads a side, cut in two, and bend it."""
    u, v = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    side, corners, triangles = _cut_quads(cells, cells), [], []
    for axis in range(3):
        for at in (0, cells):
            place = np.empty((cells + 1, cells + 1, 3), dtype=np.int64)
            place[..., axis], place[..., axis - 2], place[..., axis - 1] = at, u, v
            triangles.append((side if at else side[:, ::-1]) + len(corners) * (cells + 1) ** 2)
            corners.append(place.reshape(-1, 3))
    lattice, number = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    flat = 2 * lattice / cells - 1
    waves = 0.02 * np.sin(7 * flat[:, [1, 2, 0]]) * np.cos(5 * flat[:, [2, 0, 1]])
    return Mesh(flat * (1 + waves), number.reshape(-1)[np.concatenate(triangles)])


def shuffled(mesh: Mesh, seed: int = 0) -> Mesh:
    """Return the mesh with vertices and faces in random order: the worst case for caches."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[order] = mesh.vertices
    return Mesh(vertices, order[mesh.faces][rng.permutation(len(mesh.faces))])


ORDERS = {
    "closed": torus,
    "open": patch,
    "shuffled": lambda faces: shuffled(torus(faces)),
    "a third bent": lambda faces: patch(faces, 1 / 3),
    "parts": parts,
    "quads": quads,
}
