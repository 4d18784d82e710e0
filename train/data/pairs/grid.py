"""Closed surfaces of revolution and tubes, as quads that are cut into triangles: as modellers do.

Most of them cut all quads the same way. A correction that follows the diagonals shows as ripples on
exactly these meshes, so that training has to see them. Poles have 5 … 29 neighbours.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common import Mesh
from train.data.pairs.references import Pair, Reference
from train.surfaces.solids import random_rotation

# u, v in [0, 1] to points; v goes round.
Parametrised = Callable[[Float[np.ndarray, " N"], Float[np.ndarray, " N"]], np.ndarray]

KINDS = {"globe": 0.4, "ring": 0.35, "tube": 0.25}
CUTS = {"one way": 0.75, "in turn": 0.1, "at random": 0.15}
# How often one of rows and columns is many, and the other few.
THIN = 0.25

# Rows and columns, at least, of the mesh that stands for the surface itself.
FINE = 200


def grid_pair(rng: np.random.Generator) -> Pair:
    """Return a coarse grid on a random surface of one of the kinds, turned at random."""
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    rows, columns = int(rng.integers(4, 30)), int(rng.integers(5, 30))
    if rng.random() < THIN:
        rows, columns = rng.permutation([rng.integers(4, 12), rng.integers(50, 110)]).tolist()
    point_at = {"globe": _globe, "ring": _ring, "tube": _tube}[kind](rng)
    coarse = grid_mesh(point_at, kind, rows, columns, random_cut(rows, columns, rng))
    down, along = (-(-FINE // count) * count for count in (rows, columns))
    fine = grid_mesh(point_at, kind, down, along, np.zeros(down * along, dtype=bool))
    turn = random_rotation(rng)
    surface = Reference(fine.vertices @ turn, vertex_normals(fine) @ turn)
    return Pair("grid", Mesh(coarse.vertices @ turn, coarse.faces), surface)


def random_cut(rows: int, columns: int, rng: np.random.Generator) -> Bool[np.ndarray, " Q"]:
    """Return for each quad of a grid whether its diagonal runs the other way."""
    cell = np.arange(rows * columns)
    return {
        "one way": np.zeros(rows * columns, dtype=bool),
        "in turn": (cell // columns + cell % columns) % 2 == 1,
        "at random": rng.random(rows * columns) < 0.5,
    }[str(rng.choice(list(CUTS), p=list(CUTS.values())))]


def grid_mesh(
    point_at: Parametrised, kind: str, rows: int, columns: int, other_way: Bool[np.ndarray, " Q"]
) -> Mesh:
    """Return the mesh of a parametrised surface; a globe's ends are poles, a tube's are open."""
    lines = rows if kind == "ring" else rows + 1
    u, v = (axis.ravel() for axis in np.mgrid[:lines, :columns])
    points = point_at(u / rows, v / columns)
    number = np.arange(len(points)).reshape(lines, columns)
    if kind == "globe":
        number[0], number[-1] = number[0, 0], number[-1, 0]
    number = np.c_[number, number[:, :1]]
    number = np.r_[number, number[:1]] if kind == "ring" else number
    faces = cut_quads(number, other_way)
    used, renumbered = np.unique(faces, return_inverse=True)
    return _outwards(points[used], renumbered.reshape(-1, 3))


def cut_quads(
    number: Int[np.ndarray, "R C"], other_way: Bool[np.ndarray, " Q"]
) -> Int[np.ndarray, "F 3"]:
    """Return the triangles of the quads between a lattice's points, without those of no area."""
    low, high = number[:-1], number[1:]
    a, b, c, d = (part.ravel() for part in (low[:, :-1], high[:, :-1], high[:, 1:], low[:, 1:]))
    rising, falling = np.stack([a, b, c, a, c, d], axis=1), np.stack([a, b, d, b, c, d], axis=1)
    faces = np.where(other_way[:, None], falling, rising).reshape(-1, 3)
    return faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


def _globe(rng: np.random.Generator) -> Parametrised:
    lumps, phase, axes = rng.uniform(-0.3, 0.3, 2), rng.uniform(0, 6.3, 2), rng.uniform(0.4, 1.6, 3)

    def point_at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        t = np.pi * u
        first, second = (np.sin(turns * t + p) ** 2 for turns, p in zip((1, 2), phase, strict=True))
        bulge = lumps[0] * first + lumps[1] * second
        return _turned(np.sin(t) * (1 + bulge), -np.cos(t), v) * axes

    return point_at


def _ring(rng: np.random.Generator) -> Parametrised:
    radius, tube, lump = rng.uniform(0.6, 1.0), rng.uniform(0.1, 0.5), rng.uniform(-0.15, 0.15)
    phase, axes = rng.uniform(0, 6.3), np.append(rng.uniform(0.4, 1.6, 2), 1.0)

    def point_at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        t = 2 * np.pi * u
        thick = tube * (1 + lump * np.cos(2 * t + phase))
        return _turned(radius + thick * np.cos(t), thick * np.sin(t), v) * axes

    return point_at


def _tube(rng: np.random.Generator) -> Parametrised:
    lump = rng.uniform(-0.3, 0.3) * (rng.random() < 0.5)
    phase, axes, length = rng.uniform(0, 6.3), rng.uniform(0.4, 1.6, 2), rng.uniform(0.8, 3.2)

    def point_at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return _turned(0.5 * (1 + lump * np.sin(3 * u + phase)), length * (u - 0.5), v) * np.append(
            axes, 1.0
        )

    return point_at


def _turned(radius: np.ndarray, height: np.ndarray, v: np.ndarray) -> Float[np.ndarray, "N 3"]:
    angle = 2 * np.pi * v
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height + 0 * angle], axis=-1)


def _outwards(points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Mesh:
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = (a * np.cross(b, c)).sum() < 0
    return Mesh(points, faces[:, ::-1] if inward else faces)


def vertex_normals(mesh: Mesh) -> Float[np.ndarray, "V 3"]:
    """Return unit normals, the faces' mean by area."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    summed = np.zeros_like(mesh.vertices)
    np.add.at(summed, mesh.faces.reshape(-1), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    return summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12)
