"""One step of Loop or Catmull–Clark, written plainly: one vertex after the other, nothing shared.

Certificates measure displacements from these positions, so that an error in the operator's own
masks or topology shows as a displacement that the envelope does not allow.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

Points = Float[np.ndarray, "V 3"]
Point = Float[np.ndarray, "3"]
Face = Sequence[int]


@dataclass(frozen=True, eq=False)
class PlainStep:
    """One step: old vertices, then one for each edge in order of appearance, then for each face.

    Attributes:
        positions: where the base scheme puts them; Loop has none for faces.
        reach: the displacement's h there: the edge's length at an interior edge, the root mean
            square length of the edges of a face, and of those around an old vertex with interior
            edges only but for one crease that ends there, and 0 where no correction is allowed.
        curve_reach: the same where a rule for curves may move what lies on them: the length of a
            boundary edge or a crease, and the root mean square of both at a vertex on two of them
            and no other sharp edge; 0 elsewhere.
        labels: what each vertex is, for messages.
        triangles: the refined faces: triangles, or at each corner of a quad it and its neighbours.
    """

    positions: Float[np.ndarray, "N 3"]
    reach: Float[np.ndarray, " N"]
    curve_reach: Float[np.ndarray, " N"]
    labels: list[str]
    triangles: Int[np.ndarray, "T 3"]


@dataclass(frozen=True)
class _Masks:
    """The masks of a scheme, and its children.

    Attributes:
        edge: places the vertex of a smooth edge, from its ends and its two faces.
        vertex: places a smooth vertex, from its neighbours and the faces around it.
        children: returns triangles, from a face, the vertices of its edges, and its own.
        of_faces: whether faces have vertices.
    """

    edge: Callable[[Points, Face, Sequence[Face]], Point]
    vertex: Callable[[Points, int, list[int], list[Face]], Point]
    children: Callable[[Face, Face, int], list[tuple[int, ...]]]
    of_faces: bool


def plain_loop(
    vertices: Points, faces: Iterable[Iterable[int]], creases: Int[np.ndarray, "N 2"] | None = None
) -> PlainStep:
    """Subdivide triangles once by Loop's masks.

    ``creases`` are edges to be kept sharp: pairs of vertices, the lower first.
    """
    return _step(vertices, faces, creases, _Masks(_loop_edge, _loop_vertex, _four, of_faces=False))


def plain_catmull_clark(
    vertices: Points, faces: Iterable[Iterable[int]], creases: Int[np.ndarray, "N 2"] | None = None
) -> PlainStep:
    """Subdivide faces of any degree once by Catmull–Clark's masks; `creases` as in `plain_loop`."""
    masks = _Masks(_catmull_clark_edge, _catmull_clark_vertex, _quads, of_faces=True)
    return _step(vertices, faces, creases, masks)


def _loop_edge(points: Points, ends: Face, sides: Sequence[Face]) -> Point:
    wings = [v for face in sides for v in face if v not in ends]
    return (3 * points[list(ends)].sum(axis=0) + points[wings].sum(axis=0)) / 8


def _loop_vertex(points: Points, v: int, ring: list[int], _: list[Face]) -> Point:
    # Loop's own weights: the centre keeps (3/8 + ¼ cos 2π/k)² + 3/8.
    keep = (3 / 8 + math.cos(2 * math.pi / len(ring)) / 4) ** 2 + 3 / 8
    return keep * points[v] + (1 - keep) * points[ring].mean(axis=0)


def _four(face: Face, rim: Face, _: int) -> list[tuple[int, ...]]:
    return [*((v, rim[j], rim[j - 1]) for j, v in enumerate(face)), tuple(rim)]


def _catmull_clark_edge(points: Points, ends: Face, sides: Sequence[Face]) -> Point:
    return (points[list(ends)].sum(axis=0) + _centres(points, sides).sum(axis=0)) / 4


def _catmull_clark_vertex(points: Points, v: int, ring: list[int], around: list[Face]) -> Point:
    near = points[ring].mean(axis=0) + _centres(points, around).mean(axis=0)
    return ((len(ring) - 2) * points[v] + near) / len(ring)


def _centres(points: Points, faces: Sequence[Face]) -> Float[np.ndarray, "F 3"]:
    return np.array([points[list(face)].mean(axis=0) for face in faces])


def _quads(face: Face, rim: Face, centre: int) -> list[tuple[int, ...]]:
    quads = [(v, rim[j], centre, rim[j - 1]) for j, v in enumerate(face)]
    return [(quad[c - 1], quad[c], quad[(c + 1) % 4]) for quad in quads for c in range(4)]


def _step(
    vertices: Points,
    faces: Iterable[Iterable[int]],
    creases: Int[np.ndarray, "N 2"] | None,
    masks: _Masks,
) -> PlainStep:
    """Subdivide once; every loop here is meant to be read, not to be fast."""
    polygons = [[int(v) for v in face] for face in faces]
    named = set() if creases is None else set(map(tuple, creases.tolist()))
    uses: dict[tuple[int, int], list[tuple[Face, bool]]] = {}
    around: list[list[Face]] = [[] for _ in vertices]
    for face in polygons:
        for start, end in _sides(face):
            key = (min(start, end), max(start, end))
            uses.setdefault(key, []).append((face, start < end))
            around[start].append(face)

    neighbours: list[list[int]] = [[] for _ in vertices]
    sharp: list[list[int]] = [[] for _ in vertices]
    curves: list[list[int]] = [[] for _ in vertices]
    at_edges, edge_reach, curve_reach = [], [], []
    for (a, b), sides in uses.items():
        is_interior = len(sides) == 2 and sides[0][1] != sides[1][1]
        is_smooth = is_interior and (a, b) not in named
        is_curve = not is_smooth and (is_interior or len(sides) == 1)
        length = math.dist(vertices[a], vertices[b])
        edge_reach.append(length if is_smooth else 0.0)
        curve_reach.append(length if is_curve else 0.0)
        for vertex, neighbour in ((a, b), (b, a)):
            neighbours[vertex].append(neighbour)
            if not is_smooth:
                sharp[vertex].append(neighbour)
            if is_curve:
                curves[vertex].append(neighbour)
        if is_smooth:
            at_edges.append(masks.edge(vertices, (a, b), [face for face, _ in sides]))
        else:
            at_edges.append((vertices[a] + vertices[b]) / 2)

    moved, reach, on_curve = [], [], []
    for v, point in enumerate(vertices):
        ring = neighbours[v]
        if len(sharp[v]) > 2 or not ring:
            moved.append(point)
        elif len(sharp[v]) == 2:
            moved.append((6 * point + vertices[sharp[v]].sum(axis=0)) / 8)
        else:
            moved.append(masks.vertex(vertices, v, ring, around[v]))
        ringed = bool(ring) and (not sharp[v] or len(sharp[v]) == len(curves[v]) == 1)
        spokes = [math.dist(point, vertices[n]) for n in ring]
        reach.append(_root_mean_square(spokes) if ringed else 0.0)
        two = [math.dist(point, vertices[n]) for n in curves[v]]
        on_curve.append(_root_mean_square(two) if len(two) == len(sharp[v]) == 2 else 0.0)

    number = {key: len(vertices) + e for e, key in enumerate(uses)}
    labels = [f"vertex {v}" for v in range(len(vertices))]
    labels += [f"edge ({a}, {b})" for a, b in uses]
    triangles: list[tuple[int, ...]] = []
    for f, face in enumerate(polygons):
        rim = [number[min(side), max(side)] for side in _sides(face)]
        triangles += masks.children(face, rim, len(vertices) + len(uses) + f)
    centred = polygons if masks.of_faces else []
    of_faces = [
        _root_mean_square([math.dist(vertices[a], vertices[b]) for a, b in _sides(face)])
        for face in centred
    ]
    return PlainStep(
        np.array([*moved, *at_edges, *_centres(vertices, centred)]),
        np.array([*reach, *edge_reach, *of_faces]),
        np.array([*on_curve, *curve_reach, *(0.0 for _ in centred)]),
        [*labels, *(f"face {f}" for f in range(len(centred)))],
        np.array(triangles),
    )


def _sides(face: list[int]) -> list[tuple[int, int]]:
    return list(zip(face, [*face[1:], face[0]], strict=True))


def _root_mean_square(lengths: Sequence[float]) -> float:
    return math.sqrt(sum(length**2 for length in lengths) / len(lengths))
