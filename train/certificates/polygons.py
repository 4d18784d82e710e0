"""Certificates of a rule over Catmull–Clark: those of Loop's, with the base scheme in its place."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Creases, Mesh, catmull_clark, refine
from train.certificates.bodies import random_motion
from train.certificates.learned_once import ROUNDING_ANGLE, SAME, largest_turn
from train.certificates.plain_catmull_clark import PlainQuads, plain_catmull_clark
from train.certificates.planar_spectrum import SHARPER_EIGENVALUE, SHARPER_FLAT
from train.certificates.subject import Certificate, Subject, worst
from train.refining import AnyScheme

# Of a mesh's size: where the budget cuts off, and where it does not.
SIZES = (1.0, 2.0**-10)
EXACT = 1e-11
# Steps of derivatives at a flat star, in spokes.
TINY, FINE = 1e-8, 5e-7


@dataclass(frozen=True, eq=False)
class PolygonBody:
    """A named mesh of polygons with creases."""

    name: str
    points: Float[np.ndarray, "V 3"]
    faces: list[list[int]]
    creases: tuple[tuple[int, int], ...] = ()

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return Mesh(self.points, self.faces)

    @property
    def base(self) -> PlainQuads:
        """One step of the base scheme."""
        return plain_catmull_clark(self.points, self.faces, map(frozenset, self.creases))

    def refined(self, scheme: AnyScheme, levels: int = 1, *, limit: bool = False):
        """Refine at reference length 1 with the body's creases, sharp at one level."""
        pairs = np.array(self.creases, dtype=np.int64).reshape(-1, 2)
        creases = Creases(pairs, levels=1)
        return refine(self.mesh, scheme, levels, 1.0, limit=limit, creases=creases)  # type: ignore[arg-type]


def polygon_bodies(seed: int) -> Iterator[PolygonBody]:
    """Yield a bumpy patch, a torus, and a prism of triangles, quads and n-gons, each twice."""
    rng = np.random.default_rng(seed)
    shapes = {"patch": _patch(7), "torus": _torus(9, 6), "prism": _prism(7)}
    for name, (points, faces) in shapes.items():
        uneven = points + 0.06 * rng.standard_normal(points.shape)
        sides = sorted({tuple(sorted((f[j - 1], f[j]))) for f in faces for j in range(len(f))})
        some = tuple(sides[e] for e in sorted(rng.choice(len(sides), len(sides) // 8, False)))
        for size in SIZES:
            yield PolygonBody(f"{name}, times {size:g}", size * uneven, faces)
            yield PolygonBody(f"{name}, times {size:g}, creases", size * uneven, faces, some)


Certify = Callable[[], Certificate | list[Certificate]]


def polygon_steps(
    subject: Subject, seed: int, valences: Sequence[int]
) -> list[tuple[str, str, Certify]]:
    """Return theorem, title and work of each certificate."""
    bodies = tuple(polygon_bodies(seed))
    return [
        ("T1", "bounded displacement", lambda: bounded_displacement(subject, bodies)),
        ("T2", "equivariance", lambda: equivariance(subject, bodies, seed)),
        ("T3", "planes", lambda: planes(subject, seed)),
        ("T8", "planar spectrum", lambda: planar_spectrum(subject, valences)),
        ("folds", "fold-free", lambda: fold_free(subject, bodies)),
        ("limit", "limit distance", lambda: limit_distance(subject, bodies)),
        ("class", "smoothness class", lambda: smoothness_class(subject, bodies)),
        ("scale", "resolution independence", lambda: resolution_independence(subject, bodies)),
    ]


def bounded_displacement(subject: Subject, bodies: Sequence[PolygonBody]) -> Certificate:
    """Certify ‖x − x0‖ ≤ C h² / R at vertices, edges and faces, from an independent base."""
    measured = []
    for body in bodies:
        base, rounding = body.base, 1e-14 * float(np.abs(body.points).max())
        apart = np.linalg.norm(body.refined(subject.scheme).mesh.vertices - base.positions, axis=1)
        ratio = apart / (subject.budget * base.reach**2 + rounding)
        measured.append((float(ratio.max()), body.name))
    value, place = worst(measured)
    return Certificate("T1", "bounded displacement", value, high=SAME + 1, where=place)


def equivariance(subject: Subject, bodies: Sequence[PolygonBody], seed: int) -> list[Certificate]:
    """Certify that motions, mirrors and turning over commute with the rule, in double precision."""
    rng = np.random.default_rng(seed)
    kinds = {
        "equivariance, motions": (1.0, 1),
        "equivariance, mirrors": (-1.0, -1),
        "equivariance, turning over": (1.0, -1),
    }
    rows = []
    for name, (flip, order) in kinds.items():
        measured = []
        for body in bodies:
            turn, shift = random_motion(rng)
            turn, size = turn * [flip, 1, 1], np.abs(body.points).max()
            faces = [face[::order] for face in body.faces]
            points = body.points @ turn.T + size * shift
            moved = PolygonBody(body.name, points, faces, body.creases)
            where, still = _correspondence(body, moved), body.refined(subject.exact)
            expected = still.mesh.vertices @ turn.T + size * shift
            apart = moved.refined(subject.exact).mesh.vertices[where] - expected
            measured.append((float(np.abs(apart).max() / size), body.name))
        value, place = worst(measured)
        rows.append(Certificate("T2", name, value, high=EXACT, where=place))
    return rows


def planes(subject: Subject, seed: int) -> Certificate:
    """Certify that axis-aligned planes are the base scheme's, away from boundaries."""
    rng, measured = np.random.default_rng(seed), []
    for name, (points, faces) in {"patch": _patch(7), "star of 5": flat_star(5)}.items():
        points = points * [1, 1, 0] + 0.05 * rng.standard_normal(points.shape) * [1, 1, 0]
        body = PolygonBody(name, points, faces)
        apart = body.refined(subject.scheme).mesh.vertices - body.base.positions
        rim = {v for edge in _boundary(faces) for v in edge}
        inside = [v not in rim for v in range(len(points))]
        inside += [not edge & rim for edge in body.base.edges]
        inside += [not rim & set(face) for face in faces]
        measured.append((float(np.abs(apart[inside]).max()), name))
    value, place = worst(measured)
    return Certificate("T3", "planes", value, high=1e-14, where=place)


def planar_spectrum(subject: Subject, valences: Sequence[int]) -> list[Certificate]:
    """Certify T8: at flat k-stars of quads the linearisation is the base scheme's."""
    departures, tangents = [], []
    for k in valences:
        points, faces = flat_star(k)
        place, rows = f"k = {k}", np.arange(2 * k + 1)
        body = PolygonBody(place, points, faces)
        count, base = len(points), body.base
        spokes = [base.edges.index(frozenset((0, 1 + j))) for j in range(k)]
        near = [f for f, face in enumerate(faces) if 0 in face]
        refined = np.array([0, *(count + e for e in spokes)])
        refined = np.concatenate([refined, count + len(base.edges) + np.array(near)])

        def one_ring(
            scheme: AnyScheme, step: float, body: PolygonBody = body, refined: np.ndarray = refined
        ) -> Float[np.ndarray, "M M"]:
            moved = _copies(body, step)
            made = refine(moved, scheme, 1, 1.0, creases=None).mesh.vertices  # type: ignore[arg-type]
            return _rows_of_copies(body, made, refined)

        departed = one_ring(subject.exact, TINY) - one_ring(catmull_clark(), TINY)
        departures.append((float(np.abs(departed).max() / TINY), place))
        plus, minus = (one_ring(subject.exact, sign * FINE) for sign in (1, -1))
        inner = (3 * rows[:, None] + np.arange(3)).reshape(-1)
        matrix = ((plus - minus) / (2 * FINE))[inner].T
        size = np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
        c = math.cos(2 * math.pi / k)
        published = (5 + c + math.cos(math.pi / k) * math.sqrt(18 + 2 * c)) / 16
        # Three eigenvalues 1, the translations, then the tangent pair in three coordinates.
        tangents.append((float(np.abs(size[3:9] - published).max()), place))
    value, where = worst(departures)
    name = "planar spectrum: derivative of the departure from Catmull–Clark"
    first = Certificate("T8", name, value, high=SHARPER_FLAT, where=where)
    value, where = worst(tangents)
    name = "planar spectrum: tangent eigenvalues against the published ones"
    return [first, Certificate("T8", name, value, high=SHARPER_EIGENVALUE, where=where)]


def fold_free(subject: Subject, bodies: Sequence[PolygonBody]) -> Certificate:
    """Certify that no corner of a quad turns by more than θ from the base scheme's, in degrees."""
    card, measured = subject.learned_once, []
    angle = math.nan if card is None or card.fold_angle is None else card.fold_angle
    for body in bodies:
        base, made = body.base, body.refined(subject.scheme).mesh.vertices
        turn = largest_turn(base.corner_triangles, base.positions, made)
        measured.append((turn, body.name))
    value, place = worst(measured)
    return Certificate("folds", "fold-free", value, high=angle + ROUNDING_ANGLE, where=place)


def limit_distance(subject: Subject, bodies: Sequence[PolygonBody]) -> Certificate:
    """Certify that the limit surface is within the reported distance of the smooth base scheme's.

    The value is the largest distance as a fraction of what the report says.
    """
    measured = []
    for body in bodies:
        ours = body.refined(subject.scheme, 2, limit=True)
        theirs = PolygonBody(body.name, body.points, body.faces).refined(
            catmull_clark(), 2, limit=True
        )
        apart = np.linalg.norm(ours.mesh.vertices - theirs.mesh.vertices, axis=1).max()
        slack = 1e-14 * float(np.abs(body.points).max())
        measured.append((float(apart) / (ours.report["limit_distance"] + slack), body.name))
    value, place = worst(measured)
    return Certificate("limit", "limit distance", value, high=1 + SAME, where=place)


def smoothness_class(subject: Subject, bodies: Sequence[PolygonBody]) -> Certificate:
    """Certify that the rule is the base scheme from the level after its creases on."""
    measured = []
    for body in bodies:
        last, after = (body.refined(subject.scheme, count).mesh for count in (1, 2))
        expected = plain_catmull_clark(last.vertices, last.faces.tolist()).positions
        size = float(np.abs(body.points).max())
        measured.append((float(np.abs(after.vertices - expected).max() / size), body.name))
    value, place = worst(measured)
    return Certificate("class", "smoothness class", value, high=SAME, where=place)


def resolution_independence(subject: Subject, bodies: Sequence[PolygonBody]) -> Certificate:
    """Certify that without the budget scaling a mesh scales what is added."""
    assert subject.unbounded is not None
    measured = []
    for body in bodies:
        own = body.refined(subject.unbounded).mesh.vertices - body.base.positions
        large = PolygonBody(body.name, 32 * body.points, body.faces, body.creases)
        added = large.refined(subject.unbounded).mesh.vertices - large.base.positions
        size = float(np.abs(body.points).max())
        measured.append((float(np.abs(added / 32 - own).max() / size), body.name))
    value, place = worst(measured)
    return Certificate("scale", "resolution independence", value, high=SAME, where=place)


# --- meshes ---------------------------------------------------------------------------------------


def flat_star(k: int, rings: int = 4) -> tuple[np.ndarray, list[list[int]]]:
    """Return k sectors of rings² quads around vertex 0; then its neighbours, then opposite ones."""
    number: dict[tuple[int, int, int], int] = {(0, 0, 0): 0}
    for a, b in ((1, 0), (1, 1)):
        number |= {(j, a, b): len(number) + j for j in range(k)}

    def at(j: int, a: int, b: int) -> int:
        place = (0, 0, 0) if a == b == 0 else ((j + 1) % k, b, 0) if a == 0 else (j, a, b)
        return number.setdefault(place, len(number))

    faces = [
        [at(j, a, b), at(j, a + 1, b), at(j, a + 1, b + 1), at(j, a, b + 1)]
        for j in range(k)
        for a in range(rings)
        for b in range(rings)
    ]
    angle = 2 * np.pi / k
    places = np.array(list(number))
    spokes, (a, b) = places[:, :1] + [0, 1], places[:, 1:].T
    turns = np.stack([np.cos(spokes * angle), np.sin(spokes * angle), 0 * spokes], axis=-1)
    return a[:, None] * turns[:, 0] + b[:, None] * turns[:, 1], faces


def _patch(n: int) -> tuple[np.ndarray, list[list[int]]]:
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n), indexing="ij")
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    v = (i * n + j).reshape(-1)
    faces = np.stack([v, v + n, v + n + 1, v + 1], axis=1).tolist()
    return np.stack([x, y, 0.6 * x**2 + 0.4 * x * y], axis=-1).reshape(-1, 3), faces


def _torus(n: int, m: int) -> tuple[np.ndarray, list[list[int]]]:
    i, j = (each.reshape(-1) for each in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    u, v = 2 * np.pi * i / n, 2 * np.pi * j / m
    ring, a, b = 1 + np.cos(v) / 2, (i + 1) % n, (j + 1) % m
    points = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v) / 2], axis=1)
    return points, np.stack([i * m + j, a * m + j, a * m + b, i * m + b], axis=1).tolist()


def _prism(k: int) -> tuple[np.ndarray, list[list[int]]]:
    """Return a prism over a k-gon with a pyramid of triangles in place of one end."""
    angle = 2 * np.pi * np.arange(k) / k
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    levels = [np.column_stack([ring, np.full(k, z)]) for z in (-0.5, 0.5)]
    i, after = np.arange(k), (np.arange(k) + 1) % k
    walls = np.stack([i, after, k + after, k + i], axis=1).tolist()
    roof = np.stack([k + i, k + after, np.full(k, 2 * k)], axis=1).tolist()
    return np.concatenate([*levels, [[0, 0, 1.0]]]), [i[::-1].tolist(), *walls, *roof]


def _boundary(faces: list[list[int]]) -> list[frozenset[int]]:
    sides = [frozenset((face[j - 1], face[j])) for face in faces for j in range(len(face))]
    return [edge for edge in sides if sides.count(edge) == 1]


def _correspondence(body: PolygonBody, other: PolygonBody) -> np.ndarray:
    """Return where each new vertex of a body is in another with the same old ones."""
    places = {edge: e for e, edge in enumerate(other.base.edges)}
    count, edges = len(body.points), body.base.edges
    moved = [count + places[edge] for edge in edges]
    return np.array([*range(count), *moved, *(count + len(edges) + np.arange(len(body.faces)))])


def _copies(body: PolygonBody, step: float) -> Mesh:
    """Return copies of a mesh, copy n with its coordinate n moved."""
    count = body.points.size
    points = np.repeat(body.points[None], count, axis=0)
    points.reshape(count, -1)[np.arange(count), np.arange(count)] += step
    faces = np.array(body.faces)[None] + (np.arange(count) * len(body.points))[:, None, None]
    return Mesh(points.reshape(-1, 3), faces.reshape(-1, 4))


def _rows_of_copies(
    body: PolygonBody, made: Float[np.ndarray, "W 3"], rows: np.ndarray
) -> Float[np.ndarray, "C M"]:
    """Return some new vertices of each of the copies that were refined together."""
    copies, parts = body.points.size, (len(body.points), len(body.base.edges), len(body.faces))
    starts = np.cumsum([0, *parts])
    kind = np.searchsorted(starts, rows, side="right") - 1
    size = np.array(parts)[kind]
    place = copies * starts[kind] + rows - starts[kind]
    return made[place + np.arange(copies)[:, None] * size].reshape(copies, -1)
