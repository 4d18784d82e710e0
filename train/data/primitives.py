"""Primitives as modellers make them: coarse, sharp, with poles and long thin faces; all closed."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.connectivity import connect


def box(x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Mesh:
    """Return a box of 12 faces."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(q[0], q[i], q[i + 1]) for q in quads for i in (1, 2)]
    return Mesh(corners * [x, y, z], np.array(faces))


def tetrahedron() -> Mesh:
    """Return the regular tetrahedron."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    return Mesh(corners, np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]))


def l_block() -> Mesh:
    """Return an L of three cubes, each side two triangles a square."""
    outline = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 1]], float)
    return _extruded(outline, [(0, 1, 4, 7), (1, 2, 3, 4), (7, 4, 5, 6)])


def cylinder(sides: int, rows: int = 1, height: float = 2.0) -> Mesh:
    """Return a capped cylinder, its sides quads that are all cut the same way."""
    radius = np.ones(rows + 1)
    return _lathe(radius, np.linspace(0, height, rows + 1), sides)


def cone(sides: int) -> Mesh:
    """Return a cone with a flat base: its tip is a vertex of that many neighbours."""
    return _lathe(np.array([1.0]), np.array([0.0]), sides, top=1.5)


def globe(sides: int, rows: int) -> Mesh:
    """Return a sphere by longitude and latitude: two poles of that many neighbours."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rows + 2)[1:-1]
    return _lathe(np.cos(latitude), np.sin(latitude), sides, bottom=-1.0, top=1.0)


def torus(around: int, across: int, tube: float = 0.4) -> Mesh:
    """Return a torus of quads that are all cut the same way."""
    u, v = (2 * np.pi * np.arange(n) / n for n in (around, across))
    u, v = u[:, None], v[None, :]
    radius, height = 1 + tube * np.cos(v), tube * np.sin(v) + 0 * u
    points = np.stack([radius * np.cos(u), radius * np.sin(u), height], axis=-1).reshape(-1, 3)
    i, j = (axis.ravel() for axis in np.mgrid[:around, :across])
    a, b = i * across + j, (i + 1) % around * across + j
    c, d = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
    return Mesh(points, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3))


def icosphere(splits: int) -> Mesh:
    """Return the icosahedron, split so often and laid onto the unit sphere."""
    golden = (1 + 5**0.5) / 2
    points = [(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(p, k) for k in range(3) for p in points], dtype=float)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = (apart > 0) & (apart < 2.01)
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    mesh = _outwards(points, np.array(faces))
    for _ in range(splits):
        mesh = _split(mesh)
    return Mesh(_unit(mesh.vertices), mesh.faces)


PRIMITIVES: Mapping[str, Callable[[], Mesh]] = MappingProxyType(
    {
        "cube": box,
        "tetrahedron": tetrahedron,
        "L block": l_block,
        "thin box": lambda: box(4, 2, 0.1),
        "prism 8": lambda: cylinder(8),
        "prism 16": lambda: cylinder(16),
        "prism 32": lambda: cylinder(32),
        "cylinder 8": lambda: cylinder(8, rows=4),
        "cylinder 16": lambda: cylinder(16, rows=6),
        "cylinder 32": lambda: cylinder(32, rows=8),
        "cone 16": lambda: cone(16),
        "globe 20": lambda: globe(20, 9),
        "icosphere 20": lambda: icosphere(0),
        "icosphere 80": lambda: icosphere(1),
        "icosphere 320": lambda: icosphere(2),
    }
)

TRIANGULATED_QUADS: Mapping[str, Callable[[], Mesh]] = MappingProxyType(
    {
        "torus 12 × 8": lambda: torus(12, 8),
        "torus 24 × 12": lambda: torus(24, 12),
        "torus 48 × 24": lambda: torus(48, 24),
        "cylinder 8": PRIMITIVES["cylinder 8"],
        "cylinder 16": PRIMITIVES["cylinder 16"],
        "cylinder 32": PRIMITIVES["cylinder 32"],
    }
)


def _lathe(
    radius: Float[np.ndarray, " N"],
    height: Float[np.ndarray, " N"],
    sides: int,
    bottom: float | None = None,
    top: float | None = None,
) -> Mesh:
    """Return rings round the z axis, closed by a fan at either end; flat where no tip is given."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rows = [np.c_[r * ring, np.full(sides, z)] for r, z in zip(radius, height, strict=True)]
    tips = [height[0] if bottom is None else bottom, height[-1] if top is None else top]
    points = np.concatenate([*rows, [[0, 0, tips[0]], [0, 0, tips[1]]]])
    j, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = []
    for row in range(len(radius) - 1):
        low, high = row * sides, (row + 1) * sides
        faces += [np.c_[low + j, low + after, high + after], np.c_[low + j, high + after, high + j]]
    last, south, north = (len(radius) - 1) * sides, len(points) - 2, len(points) - 1
    faces += [np.c_[after, j, np.full(sides, south)]]
    faces += [np.c_[last + j, last + after, np.full(sides, north)]]
    return Mesh(points, np.concatenate(faces))


def _extruded(outline: Float[np.ndarray, "N 2"], quads: list[tuple[int, ...]]) -> Mesh:
    """Return a prism of height 1 over an outline, its lids given as quads seen from above."""
    count = len(outline)
    points = np.concatenate([np.c_[outline, np.zeros(count)], np.c_[outline, np.ones(count)]])
    faces = []
    for a, b, c, d in quads:
        faces += [(a + count, b + count, c + count), (a + count, c + count, d + count)]
        faces += [(a, c, b), (a, d, c)]
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, j + count), (i, j + count, i + count)]
    return Mesh(points, np.array(faces))


def _outwards(points: Float[np.ndarray, "V 3"], faces: np.ndarray) -> Mesh:
    """Return a star-shaped mesh about the origin with all faces anticlockwise from outside."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = (a * np.cross(b, c)).sum(axis=1) < 0
    return Mesh(points, np.where(inward[:, None], faces[:, ::-1], faces))


def _split(mesh: Mesh) -> Mesh:
    """Return every face in four, edges at their midpoints laid onto the unit sphere."""
    level = connect(mesh.faces, len(mesh.vertices))
    middles = mesh.vertices[level.edges.numpy()].mean(axis=1)
    return Mesh(_unit(np.concatenate([mesh.vertices, middles])), level.split().numpy())


def _unit(points: Float[np.ndarray, "V 3"]) -> Float[np.ndarray, "V 3"]:
    return points / np.linalg.norm(points, axis=1, keepdims=True)
