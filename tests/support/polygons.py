"""Polygon meshes for tests: named shapes, and hypothesis strategies for everything else."""

import numpy as np
from hypothesis import strategies as st

from pns_common import Mesh
from train.spectra import stars

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CUBE_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def uneven(points, seed=0, by=0.15):
    """Points moved at random: no symmetry, no flat face."""
    return points + by * np.random.default_rng(seed).standard_normal(points.shape)


def quad_torus(n=12, m=8, radius=2.0):
    """A closed regular mesh: n quads around, m across."""
    i, j = (each.reshape(-1) for each in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    u, v = 2 * np.pi * i / n, 2 * np.pi * j / m
    ring = radius + np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=1)
    a, b = (i + 1) % n, (j + 1) % m
    return points, np.stack([i * m + j, a * m + j, a * m + b, i * m + b], axis=1)


def quad_grid(n=5, height=None):
    """An open n × n patch over [−1, 1]² of (n − 1)² quads."""
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    z = np.zeros_like(x) if height is None else height(x, y)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    v = (i * n + j).reshape(-1)
    faces = np.stack([v, v + n, v + n + 1, v + 1], axis=1)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def quad_star(k, rings=2):
    """k sectors of quads around vertex 0, whose rings are complete; sector j has rings² quads."""
    mesh = stars.quad_star(k, rings, 1.0).mesh
    return mesh.vertices, mesh.faces


def cylinder(sides=7, height=2.0):
    """A closed solid: two n-gons and a ring of quads."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (0.0, height)])
    i = np.arange(sides)
    walls = np.stack([i, (i + 1) % sides, sides + (i + 1) % sides, sides + i], axis=1)
    return points, [i[::-1].tolist(), (sides + i).tolist(), *walls.tolist()]


def mixed_cube():
    """A cube with two triangles in place of one quad."""
    return CUBE, [*CUBE_FACES[:3], [2, 3, 7], [2, 7, 6], *CUBE_FACES[4:]]


def pillow():
    """Two quads that share two edges, within a ring: vertex 0 is interior and of valence 2."""
    points = [[0, 0, 0.4], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    points += [[2, 0, 0], [0, 2, 0], [-2, 0, 0], [0, -2, 0]]
    inner = [[0, 1, 2, 3], [0, 3, 4, 1]]
    ring = [[1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 8, 4], [4, 8, 5, 1]]
    return np.array(points, dtype=float), inner + ring


SHAPES = {
    "cube": (CUBE, CUBE_FACES),
    "open box": (CUBE, CUBE_FACES[:5]),
    "two corners of a box": (CUBE, CUBE_FACES[:4]),
    "single quad": (CUBE, CUBE_FACES[:1]),
    "mixed": mixed_cube(),
    "cylinder": cylinder(),
    "torus": quad_torus(5, 4),
    "pillow": pillow(),
    "star of 3": quad_star(3),
    "star of 7": quad_star(7),
    "pentagon": (cylinder(5)[0][:5], [[0, 1, 2, 3, 4]]),
}


def rows_of(mesh):
    return [face.tolist() for face in mesh.polygons]


def envelope(mesh, budget, length):
    """ρ = C h² / R of each new vertex, from the mesh alone."""
    points, topology = mesh.vertices, mesh.topology()
    square = np.sum((points[topology.edges[:, 1]] - points[topology.edges[:, 0]]) ** 2, axis=1)
    total, count = np.zeros(len(points)), np.zeros(len(points))
    for end in (0, 1):
        np.add.at(total, topology.edges[:, end], square)
        np.add.at(count, topology.edges[:, end], 1)
    of_faces = np.add.reduceat(square[topology.corner_edges], topology.offsets[:-1])
    means = total / np.maximum(count, 1), square, of_faces / np.diff(topology.offsets)
    return budget / length * np.concatenate(means)


def renumbered(mesh, seed):
    """Return other vertex numbers, another order of faces and first corner of each; v's numbers."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    faces = [np.roll(order[face], rng.integers(9)).tolist() for face in rows_of(mesh)]
    points = mesh.vertices[np.argsort(order)]
    return Mesh(points, [faces[f] for f in rng.permutation(len(faces))]), order


def correspondence(mesh, other, order):
    """Find where each new vertex of a mesh is in another with vertex ``order[v]`` for v."""
    ours, theirs = mesh.topology(), other.topology()
    places = {frozenset(ends): e for e, ends in enumerate(theirs.edges.tolist())}
    edges = [places[frozenset(order[list(ends)].tolist())] for ends in ours.edges.tolist()]
    faces = {frozenset(face): f for f, face in enumerate(rows_of(other))}
    within = [faces[frozenset(order[face].tolist())] for face in rows_of(mesh)]
    count, edge_count = len(mesh.vertices), len(ours.edges)
    parts = order, count + np.array(edges), count + edge_count + np.array(within)
    return np.concatenate(parts)


@st.composite
def polygon_soups(draw, repeats=True):
    """Any polygons over any points: irregular edges, repeated corners, coincident points."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(4, 12))
    faces = []
    for _ in range(draw(st.integers(1, 16))):
        degree = int(rng.integers(3, 7 if repeats else min(7, count + 1)))
        faces.append(rng.choice(count, degree, replace=repeats).tolist())
    vertices = rng.standard_normal((count, 3))
    if draw(st.booleans()):
        vertices = np.round(vertices)  # coincident points, no area
    return Mesh(10.0 ** draw(st.integers(-6, 6)) * vertices, faces)


@st.composite
def polygon_manifolds(draw):
    """Manifolds of polygons in general position, some faces left out, some renumbered."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points, faces = SHAPES[draw(st.sampled_from(sorted(SHAPES)))]
    points = points + 0.1 * rng.standard_normal(points.shape)
    order = rng.permutation(len(points))
    renumbered = np.empty_like(points)
    renumbered[order] = points
    turned = [np.roll(order[np.asarray(face)], rng.integers(9)).tolist() for face in faces]
    return Mesh(renumbered, [turned[f] for f in rng.permutation(len(turned))])
