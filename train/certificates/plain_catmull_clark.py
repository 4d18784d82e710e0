"""One step of Catmull–Clark, face by face in numpy: nothing of the library is used here."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Edge = frozenset[int]


@dataclass(frozen=True, eq=False)
class PlainQuads:
    """One step: old vertices, then those of edges by first appearance, then those of faces.

    Attributes:
        positions: where the base scheme puts them.
        reach: h of each: the edge's length; of a face and of a vertex the root mean square of its
            edges, of a vertex on a curve of those along it.
        edges: ends of the edges, in their order.
        corner_triangles: at each corner of each quad of the split it and its neighbours.
    """

    positions: Float[np.ndarray, "N 3"]
    reach: Float[np.ndarray, " N"]
    edges: Sequence[Edge]
    corner_triangles: np.ndarray


def plain_catmull_clark(
    points: Float[np.ndarray, "V 3"], faces: Sequence[Sequence[int]], creases: Iterable[Edge] = ()
) -> PlainQuads:
    """Apply the masks to a manifold mesh with hard creases."""
    sides: dict[Edge, list[int]] = {}
    for f, face in enumerate(faces):
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            sides.setdefault(frozenset((a, b)), []).append(f)
    edges, sharp = list(sides), set(creases)
    sharp |= {edge for edge, uses in sides.items() if len(uses) == 1}
    centres = np.array([points[list(face)].mean(axis=0) for face in faces])
    length = {e: float(np.linalg.norm(np.diff(points[list(e)], axis=0))) for e in edges}
    at_edges = []
    for edge in edges:
        middle = points[list(edge)].mean(axis=0)
        smooth = edge not in sharp
        at_edges.append((middle + centres[sides[edge]].mean(axis=0)) / 2 if smooth else middle)
    at_vertices, reach = [], []
    for v, p in enumerate(points):
        spokes = [edge for edge in edges if v in edge]
        beside, around = [f for f, face in enumerate(faces) if v in face], len(spokes)
        curve = [edge for edge in spokes if edge in sharp]
        far = [next(iter(edge - {v})) for edge in curve]
        place = p
        if len(curve) <= 1 and around:
            near = points[[next(iter(edge - {v})) for edge in spokes]].mean(axis=0)
            place = ((around - 2) * p + near + centres[beside].mean(axis=0)) / around
        elif len(curve) == 2:
            place = 3 / 4 * p + points[far].sum(axis=0) / 8
        at_vertices.append(place)
        seen = curve if len(curve) > 1 else spokes
        reach.append(_root_mean_square([length[edge] for edge in seen]))
    number = {edge: len(points) + e for e, edge in enumerate(edges)}
    triangles: list[tuple[int, ...]] = []
    reach += [length[edge] for edge in edges]
    for f, face in enumerate(faces):
        rim = [number[frozenset((face[j], face[(j + 1) % len(face)]))] for j in range(len(face))]
        reach.append(_root_mean_square([reach[e] for e in rim]))
        for j, v in enumerate(face):
            quad = v, rim[j], len(points) + len(edges) + f, rim[j - 1]
            triangles += [(quad[c - 1], quad[c], quad[(c + 1) % 4]) for c in range(4)]
    positions = np.concatenate([at_vertices, at_edges, centres])
    return PlainQuads(positions, np.array(reach), edges, np.array(triangles))


def _root_mean_square(lengths: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(lengths)))) if len(lengths) else 0.0
