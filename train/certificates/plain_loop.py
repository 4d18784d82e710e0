"""Loop subdivision once more, written plainly: one vertex after the other, nothing shared.

Certificates measure displacements from these positions, so that an error in the operator's own
masks or topology shows as a displacement that the envelope does not allow.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False)
class PlainLoop:
    """One step of Loop: old vertices first, then one vertex for each edge in order of appearance.

    Attributes:
        positions: where Loop puts them.
        reach: the displacement's h there: the edge's length at an interior edge, the root mean
            square length of the edges around an old vertex with interior edges only but for one
            crease that ends there, and 0 where no correction is allowed.
        curve_reach: the same where a rule for curves may move what lies on them: the length of a
            boundary edge or a crease, and the root mean square of both at a vertex on two of them
            and no other sharp edge; 0 elsewhere.
        labels: what each vertex is, for messages.
    """

    positions: Float[np.ndarray, "N 3"]
    reach: Float[np.ndarray, " N"]
    curve_reach: Float[np.ndarray, " N"]
    labels: list[str]


def plain_loop(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    creases: Int[np.ndarray, "N 2"] | None = None,
) -> PlainLoop:
    """Subdivide once; every loop here is meant to be read, not to be fast.

    ``creases`` are edges to be kept sharp: pairs of vertices, the lower first.
    """
    named = set() if creases is None else set(map(tuple, creases.tolist()))
    opposites: dict[tuple[int, int], list[tuple[int, bool]]] = {}
    for a, b, c in faces.tolist():
        for start, end, opposite in ((a, b, c), (b, c, a), (c, a, b)):
            key = (min(start, end), max(start, end))
            opposites.setdefault(key, []).append((opposite, start < end))

    neighbours: list[list[int]] = [[] for _ in vertices]
    sharp: list[list[int]] = [[] for _ in vertices]
    curves: list[list[int]] = [[] for _ in vertices]
    edge_positions, edge_reach, curve_reach = [], [], []
    labels = [f"vertex {v}" for v in range(len(vertices))]
    for (a, b), sides in opposites.items():
        for vertex, neighbour in ((a, b), (b, a)):
            neighbours[vertex].append(neighbour)
        labels.append(f"edge ({a}, {b})")
        is_interior = len(sides) == 2 and sides[0][1] != sides[1][1]
        is_crease = is_interior and (a, b) in named
        if is_interior and not is_crease:
            (c, _), (d, _) = sides
            ends, wings = vertices[a] + vertices[b], vertices[c] + vertices[d]
            edge_positions.append((3 * ends + wings) / 8)
            edge_reach.append(math.dist(vertices[a], vertices[b]))
            curve_reach.append(0.0)
        else:
            edge_positions.append((vertices[a] + vertices[b]) / 2)
            edge_reach.append(0.0)
            is_curve = is_crease or len(sides) == 1
            curve_reach.append(math.dist(vertices[a], vertices[b]) if is_curve else 0.0)
            for vertex, neighbour in ((a, b), (b, a)):
                sharp[vertex].append(neighbour)
                if is_curve:
                    curves[vertex].append(neighbour)

    moved, reach, on_curve = [], [], []
    for v, point in enumerate(vertices):
        ring = neighbours[v]
        if len(sharp[v]) > 2 or not ring:
            moved.append(point)
        elif len(sharp[v]) == 2:
            moved.append((6 * point + vertices[sharp[v]].sum(axis=0)) / 8)
        else:
            # Loop's own weights: the centre keeps (3/8 + ¼ cos 2π/k)² + 3/8.
            keep = (3 / 8 + math.cos(2 * math.pi / len(ring)) / 4) ** 2 + 3 / 8
            moved.append(keep * point + (1 - keep) * vertices[ring].mean(axis=0))
        ringed = bool(ring) and (not sharp[v] or len(sharp[v]) == len(curves[v]) == 1)
        squares = [math.dist(point, vertices[n]) ** 2 for n in ring]
        reach.append(math.sqrt(sum(squares) / len(ring)) if ringed else 0.0)
        two = [math.dist(point, vertices[n]) ** 2 for n in curves[v]]
        on_curve.append(math.sqrt(sum(two) / 2) if len(two) == len(sharp[v]) == 2 else 0.0)

    positions = np.array([*moved, *edge_positions])
    return PlainLoop(
        positions,
        np.array([*reach, *edge_reach]),
        np.array([*on_curve, *curve_reach]),
        labels,
    )
