"""k-stars: a vertex of valence k in regular rings, refined vertices that repeat them, symmetries.

What commutes with turns and a mirror falls into small blocks. Within a block eigenvalues are
simple, and a tangent can only be confused with another eigenvalue of its own block: so eigenvalues
of one block are followed apart from those of the others.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh

# Place (sector, i, j) is i steps along the sector's first spoke and j along its second.
Place = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Star:
    """A valence-k star in the plane z = 0, its centre lifted.

    Attributes:
        mesh: the star; the outermost ring is its boundary.
        inner: vertices of the inner rings, the centre first.
        refined: after one step, the vertices that stand in for `inner`: the same rings around the
            same centre at half the size, in the same order.
    """

    mesh: Mesh
    inner: Int[np.ndarray, " N"]
    refined: Int[np.ndarray, " N"]


BuildStar = Callable[..., Star]


def star(
    valence: int, rings: int, spoke: float, lift: float = 0.0, *, inner_rings: int = 2
) -> Star:
    """Build a star of equilateral lattice sectors.

    Args:
        valence: k ≥ 3.
        rings: rings around the centre, the boundary included.
        spoke: length of the spokes.
        lift: height of the centre, in spokes.
        inner_rings: rings that the spectrum looks at; with two of them Loop's spectrum is whole
            (one ring misses its eigenvalue 1/8).
    """
    faces: list[list[Place]] = []
    for s, i in product(range(valence), range(rings)):
        for j in range(rings - i):
            faces.append([(s, i, j), (s, i + 1, j), (s, i, j + 1)])
            if i + j + 2 <= rings:
                faces.append([(s, i + 1, j), (s, i + 1, j + 1), (s, i, j + 1)])
    ringed = [[(ring - j, j) for j in range(ring)] for ring in range(rings + 1)]
    return _build(valence, ringed, faces, spoke, lift, inner_rings)


def quad_star(
    valence: int, rings: int, spoke: float, lift: float = 0.0, *, inner_rings: int = 2
) -> Star:
    """Build a star of sectors of rings² quads; arguments as for `star`."""
    cells = product(range(valence), range(rings), range(rings))
    faces = [[(s, i, j), (s, i + 1, j), (s, i + 1, j + 1), (s, i, j + 1)] for s, i, j in cells]
    ringed = [
        [*((ring, j) for j in range(ring + 1)), *((i, ring) for i in range(ring - 1, 0, -1))]
        for ring in range(rings + 1)
    ]
    return _build(valence, ringed, faces, spoke, lift, inner_rings)


def _build(
    valence: int,
    ringed: list[list[tuple[int, int]]],
    faces: list[list[Place]],
    spoke: float,
    lift: float,
    inner_rings: int,
) -> Star:
    """Build a star from its faces and the places of a sector, ring by ring.

    A spoke belongs to the sector that it begins.
    """
    places: list[Place] = [(0, 0, 0)]
    for row, sector in product(ringed[1:], range(valence)):
        places += [(sector, i, j) for i, j in row]
    number = {place: v for v, place in enumerate(places)}
    points = np.array([_position(place, valence) for place in places]) * spoke
    points[0, 2] = lift * spoke

    def vertices(face: Iterable[Place]) -> list[int]:
        return [number[_canonical(*place, valence)] for place in face]

    mesh = Mesh(points, [vertices(face) for face in faces])
    rows = mesh.faces
    sides = np.stack([rows, np.roll(rows, -1, axis=1)], axis=-1).reshape(-1, 2)
    made = [*({v} for v in range(len(places))), *sides.tolist(), *rows.tolist()]
    new = {ends: w for w, ends in enumerate(dict.fromkeys(map(frozenset, made)))}
    # At half the size, place (i, j) is half-way between one, two or four places of the old star.
    inner = places[: 1 + valence * sum(map(len, ringed[1 : inner_rings + 1]))]
    ends = [_ends(place, of_quads=not mesh.triangles) for place in inner]
    refined = [new[frozenset(vertices(between))] for between in ends]
    return Star(mesh, np.arange(len(inner)), np.array(refined))


def _ends(place: Place, *, of_quads: bool) -> list[Place]:
    """Return the places that a place at half the size lies between."""
    sector, i, j = place
    low_i, high_i, low_j, high_j = i // 2, i - i // 2, j // 2, j - j // 2
    if of_quads:
        return [(sector, *ends) for ends in product((low_i, high_i), (low_j, high_j))]
    return [(sector, low_i, high_j), (sector, high_i, low_j)]


def _canonical(sector: int, i: int, j: int, valence: int) -> Place:
    if i == j == 0:
        return (0, 0, 0)
    return ((sector + 1) % valence, j, 0) if i == 0 else (sector % valence, i, j)


def _position(place: Place, valence: int) -> Float[np.ndarray, "3"]:
    sector, i, j = place
    first, second = (2 * np.pi * (sector + step) / valence for step in (0, 1))
    x = i * np.cos(first) + j * np.cos(second)
    y = i * np.sin(first) + j * np.sin(second)
    return np.array([x, y, 0.0])


# An orthonormal basis of an invariant subspace.
Subspace = Float[np.ndarray, "M D"]
# What rounding may take out of a block, of a matrix's largest entry.
ROUNDING = 1e-7


def symmetry_blocks(star: Star, valence: int) -> tuple[Subspace, ...]:
    """Return orthonormal bases, together of the whole space of inner coordinates.

    One for each frequency 0 … k/2 of a vector field around the star, and each of its two parts
    under a mirror: of a frequency between, the parts have one spectrum twice.
    """
    points = star.mesh.vertices[star.inner]
    turn, mirror = _representation(points, _turn(valence)), _representation(points, _MIRROR)
    powers = [np.eye(len(turn))]
    for _ in range(valence - 1):
        powers.append(powers[-1] @ turn)
    blocks: list[Subspace] = []
    for frequency in range(valence // 2 + 1):
        part = (
            sum(
                np.cos(2 * np.pi * frequency * step / valence) * power
                for step, power in enumerate(powers)
            )
            / valence
        )
        if 0 < 2 * frequency < valence:
            part = 2 * part
        for sign in (1, -1):
            projector = part @ (np.eye(len(turn)) + sign * mirror) / 2
            values, vectors = np.linalg.eigh((projector + projector.T) / 2)
            if values[-1] > 1 / 2:
                blocks.append(vectors[:, values > 1 / 2])
    return tuple(blocks)


def keeps_blocks(matrix: Float[np.ndarray, "M M"], blocks: tuple[Subspace, ...]) -> bool:
    """Return whether a matrix maps every block to itself, but for rounding."""
    kept = sum(block @ (block.T @ matrix @ block) @ block.T for block in blocks)
    return bool(np.abs(matrix - kept).max() <= ROUNDING * np.abs(matrix).max())


# The first spoke lies on the x axis.
_MIRROR = np.diag([1.0, -1.0, 1.0])


def _turn(valence: int) -> Float[np.ndarray, "3 3"]:
    angle = 2 * np.pi / valence
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _representation(
    points: Float[np.ndarray, "N 3"], motion: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "M M"]:
    """Return how a motion of the star onto itself acts on the coordinates of its vertices."""
    plane = np.array([1.0, 1.0, 0.0])
    moved = (points * plane) @ motion.T
    apart = np.linalg.norm(moved[:, None] - (points * plane)[None], axis=2)
    permutation = np.zeros((len(points), len(points)))
    permutation[np.argmin(apart, axis=1), np.arange(len(points))] = 1
    return np.kron(permutation, motion)
