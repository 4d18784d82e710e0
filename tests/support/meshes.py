"""Meshes for tests: shapes with names, and hypothesis strategies for everything else."""

import numpy as np
import trimesh
from hypothesis import strategies as st

from pns_common import Mesh

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def icosphere(subdivisions=1, radius=1.0):
    """Vertices on a sphere, faces anticlockwise from outside: closed, valences 5 and 6."""
    made = trimesh.creation.icosphere(subdivisions, radius)
    return np.array(made.vertices), np.array(made.faces, dtype=np.int64)


def bumpy_sphere(seed=0, subdivisions=1, bump=0.15):
    """A closed surface without symmetry."""
    points, faces = icosphere(subdivisions)
    rng = np.random.default_rng(seed)
    return points * (1 + bump * rng.uniform(-1, 1, (len(points), 1))), faces


def grid(n=6, height=None):
    """An open n × n patch over [−1, 1]²; ``height(x, y)`` lifts it."""
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    z = np.zeros_like(x) if height is None else height(x, y)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    v = (i * n + j).reshape(-1)
    faces = np.concatenate(
        [np.stack([v, v + n, v + n + 1], axis=1), np.stack([v, v + n + 1, v + 1], axis=1)]
    )
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def tilted_plane(seed):
    """An uneven patch of a plane that lies anyhow."""
    rng = np.random.default_rng(seed)
    vertices, faces = grid(5)
    vertices[:, :2] += rng.uniform(-0.1, 0.1, (len(vertices), 2))
    return Mesh(vertices @ rotation(rng).T, faces)


def bent(x, y):
    """A height with ridges and no symmetry."""
    return 0.4 * np.exp(-6 * (x + 0.3 * y) ** 2) + 0.1 * np.sin(3 * y)


def bow_tie():
    """Two triangles that share one vertex only."""
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0.5], [-1, -1, 0]]
    return np.array(vertices, dtype=float), np.array([[0, 1, 2], [0, 3, 4]])


def three_pages():
    """Three triangles on one edge."""
    vertices = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]]
    return np.array(vertices, dtype=float), np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])


def one_way_pair():
    """Two triangles that run along their shared edge in the same direction."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, -1, 0]]
    return np.array(vertices, dtype=float), np.array([[0, 1, 2], [0, 1, 3]])


def every_edge_class():
    """Vertices and faces by name: small meshes that together have each class of edge."""
    return {
        "closed": bumpy_sphere(0),
        "open": grid(6, bent),
        "bow-tie": bow_tie(),
        "three pages": three_pages(),
        "one-way pair": one_way_pair(),
        "isolated vertex": (np.vstack([grid(3)[0], [[9, 9, 9]]]), grid(3)[1]),
    }


def rotation(rng):
    """A random rotation matrix."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]]


@st.composite
def soups(draw):
    """Any faces over any points: irregular edges, bow-ties, degenerate faces, unused vertices."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(3, 12))
    faces = rng.integers(0, count, (draw(st.integers(1, 30)), 3))
    scale = 10.0 ** draw(st.integers(-6, 6))
    vertices = scale * rng.standard_normal((count, 3))
    if draw(st.booleans()):
        vertices = np.round(vertices / scale) * scale  # coincident points, no area
    return Mesh(vertices, faces)


@st.composite
def manifolds(draw):
    """Closed and open manifolds in general position, some renumbered."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from(["sphere", "grid", "tetrahedron"]))
    if kind == "sphere":
        vertices, faces = icosphere(draw(st.integers(0, 1)))
    elif kind == "grid":
        vertices, faces = grid(draw(st.integers(2, 6)), bent)
    else:
        vertices, faces = rng.standard_normal((4, 3)), TETRAHEDRON
    vertices = vertices + 0.1 * rng.standard_normal(vertices.shape)
    order = rng.permutation(len(vertices))
    renumbered = np.empty_like(vertices)
    renumbered[order] = vertices
    return Mesh(renumbered, order[faces][rng.permutation(len(faces))])


def block(cells=3, noise=0.0, seed=0, closed=True):
    """A box of cells³ squares, outwards: twelve crease lines; not ``closed``: without its lid."""
    side = np.linspace(-1, 1, cells + 1)
    u, v = (values.reshape(-1) for values in np.meshgrid(side, side, indexing="ij"))
    quads = [
        (i * (cells + 1) + j, (i + 1) * (cells + 1) + j, (i + 1) * (cells + 1) + j + 1)
        for i in range(cells)
        for j in range(cells)
    ]
    lower = np.array(quads)
    upper = lower[:, [0, 2, 2]] - [0, 0, cells + 1]
    one = np.concatenate([lower, upper])
    points, faces = [], []
    for axis in range(3):
        for sign in (-1, 1):
            if axis == 2 and sign == 1 and not closed:
                continue
            faces.append((one if sign > 0 else one[:, ::-1]) + len(u) * len(points))
            points.append(
                np.roll(np.stack([u, v, np.full(len(u), sign)], axis=1), axis + 1, axis=1)
            )
    sides = np.concatenate(points)
    rounded = np.round(sides * 4 * cells)
    _, first, number = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    rng = np.random.default_rng(seed)
    points = sides[first] + noise * rng.standard_normal((len(first), 3))
    return points, number.reshape(-1)[np.concatenate(faces)]


def prism(profile):
    """A convex profile, drawn along z."""
    n = len(profile)
    points = np.concatenate([np.c_[profile, np.zeros(n)], np.c_[profile, np.full(n, 3.0)]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    fan = np.stack([0 * k[2:], k[1:-1], k[2:]], axis=1)
    walls = [np.c_[k, after, n + after], np.c_[k, n + after, n + k]]
    return Mesh(points, np.concatenate([*walls, fan[:, ::-1], fan + n]))
