"""Bounds of the distance between triangles with corners on the limit surface and their patches.

The patch of a face is the part of the limit surface that the face becomes. Its slab is how far it
reaches to both sides of the plane of its triangle and, where a side is sharp, how far its curve is
from the side (kernels/flatness.py). docs/explanation/adaptive.md proves the bounds, and says what
they promise.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations_with_replacement, permutations

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.adaptive.parts import CHILD_WEIGHTS, CHILDREN, Levels, Part
from pns_common.kernels import connectivity
from pns_common.kernels import flatness as kernels
from pns_common.mesh.creases import edge_cosines
from pns_common.mesh.rows import cross, dot, marked, ranges, unit
from pns_common.schemes.loop_weights import beta

# The side of a face that each side of its children is half of, from (a, ab, ca) on, or NO_SIDE.
OF_CHILDREN = np.array([[0, 3, 2], [1, 3, 0], [2, 3, 1], [3, 3, 3]])
NO_SIDE = 3
# Sides are measured as curves where faces turn by more than 60 degrees, in cosines.
FOLD = 1 / 2
LOW, HIGH, SIDE, UNKNOWN = range(4)


def slabs(
    part: Part,
    faces: Integer[np.ndarray, " N *D"],
    triangles: Float[np.ndarray, "N 3 3"],
    sides: Bool[np.ndarray, "N 3"],
    levels: Levels,
    deeper: int,
    enough: float,
) -> Float[np.ndarray, "N 3"]:
    """Return the slabs of faces about their triangles: low, high, and at sides.

    Args:
        part: the faces, or what they become so many levels deeper.
        faces: rows of the faces, or of all 4 ** deeper that each becomes.
        triangles: corners of the faces, on the limit surface.
        sides: which sides are to be measured as curves: see ``folded``.
        levels: the rules.
        deeper: 0 or 1.
        enough: slabs that are smaller need not be exact; 0: all need.
    """
    count, each = len(faces), CHILDREN**deeper
    of_face = OF_CHILDREN if deeper else np.array([[0, 1, 2]])
    asked = np.hstack([sides, np.zeros((count, 1), dtype=bool)])[:, of_face]
    compared = np.ascontiguousarray(np.where(asked, of_face, -1).reshape(-1, 3), dtype=np.int32)
    about = triangles.repeat(each, axis=0)
    of_sides = compared, np.ascontiguousarray(sides.repeat(each, axis=0))
    made = _measured(part, faces.reshape(-1).astype(np.int64), about, of_sides, levels, enough)
    made = made.reshape(count, each, -1)
    return np.column_stack(
        [made[:, :, LOW].min(axis=1), made[:, :, HIGH].max(axis=1), made[:, :, SIDE].max(axis=1)]
    )


@cache
def net_of_quartics() -> Float[np.ndarray, "12 N"]:
    """Return the weights of a regular patch's control points in Bernstein ordinates of its pieces.

    The patch is a quartic, and so is each quarter of it. Points are those of ``measure_faces``.
    """
    blossom = np.zeros((3, 3, 3, 3, 12))
    for c in range(3):
        n, p = (c + 1) % 3, (c + 2) % 3
        star = [4 * c, 4 * n, 4 * p, 4 * c + 1, 4 * c + 2, 4 * c + 3, 4 * n + 1]
        for at, weights in (
            ((c, c, c, c), (12, 2, 2, 2, 2, 2, 2)),
            ((c, c, c, n), (12, 4, 3, 1, 0, 1, 3)),
            ((c, c, c, p), (12, 3, 4, 3, 1, 0, 1)),
            ((c, c, n, n), (8, 8, 4, 0, 0, 0, 4)),
            ((c, c, n, p), (10, 6, 6, 1, 0, 0, 1)),
        ):
            for order in permutations(at):
                blossom[order][star] = np.array(weights) / 24
    made = list[np.ndarray]()
    for child in CHILD_WEIGHTS:
        own = np.einsum("abcdx,ia,jb,kc,ld->ijklx", blossom, child, child, child, child)
        made.extend(own[at] for at in combinations_with_replacement(range(3), 4))
    # Whole multiples of 1 / (24 · 16): pieces meet in ordinates that are equal.
    return np.ascontiguousarray(np.unique(np.rint(384 * np.array(made)), axis=0).T) / 384


def folded(part: Part) -> Bool[np.ndarray, " E"]:
    """Return the edges beyond which no neighbour's slab bounds what reaches over them."""
    mesh = part.topology
    rim = (mesh.edge_class == connectivity.BOUNDARY) | (mesh.edge_class == connectivity.IRREGULAR)
    # Creases are edges between two faces there.
    turned = edge_cosines(part.points, mesh.without_creases()) < FOLD
    return rim | turned


def distances(slabs: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
    """Return how far patches can be from their triangles."""
    return np.maximum(np.maximum(-slabs[:, LOW], slabs[:, HIGH]), slabs[:, SIDE])


def cut_distances(
    slabs: Float[np.ndarray, "N 3"],
    triangles: Float[np.ndarray, "N 3 3"],
    points: Float[np.ndarray, "M 3"],
    offsets: Integer[np.ndarray, " N1"],
) -> Float[np.ndarray, " N"]:
    """Return how far patches can be from what fills outlines of their triangles.

    That lies at heights between those of the outline's points, corners among them. Where one is not
    known (NaN) it lies in the slab, so both are apart by no more than the slab is wide.
    """
    a, b, c = (triangles[:, k] for k in range(3))
    counts, normals = np.diff(offsets), unit(cross(b - a, c - a))
    heights = dot(points - np.repeat(a, counts, axis=0), np.repeat(normals, counts, axis=0))
    least, most = (by.reduceat(heights, offsets[:-1]) for by in (np.minimum, np.maximum))
    low, high = slabs[:, LOW], slabs[:, HIGH]
    known = np.maximum(high - np.minimum(least, 0), np.maximum(most, 0) - low)
    sizes = np.where(np.isnan(least), high - low, known)
    # What lies beyond a side is so far from where the side was, which new corners may move.
    side = slabs[:, SIDE]
    return np.maximum(sizes, np.where(side > 0, distances(slabs) + side, 0.0))


def _measured(
    part: Part,
    faces: Integer[np.ndarray, " N"],
    triangles: Float[np.ndarray, "N 3 3"],
    sides: tuple[Integer[np.ndarray, "N 3"], Bool[np.ndarray, "N 3"]],
    levels: Levels,
    enough: float,
) -> Float[np.ndarray, "N 4"]:
    mesh, steps = part.topology, kernels.DEEPEST
    wears = np.isfinite(mesh.wear[mesh.wear > 0]).any()
    wears |= np.isfinite(mesh.vertex_sharpness[mesh.vertex_sharpness > 0]).any()
    if wears or not levels.lasts(part.depth):
        # Rules change further down: what holds for all of them is all that is known.
        mesh, steps = mesh.without_creases(), 0
    rules = np.zeros((mesh.vertex_count, 2))
    if mesh.sharpest is not None:
        rules = np.ascontiguousarray(mesh.sharpest.weights[:, 1:])
    made, points = np.empty((len(faces), 4)), part.points
    read = points, mesh.corners, mesh.corner_edges, mesh.half_edges, mesh.edge_class
    net = net_of_quartics()
    rings = mesh.sharpness, mesh.valence, rules, beta(np.arange(kernels.MOST + 1)), net
    asked = faces, np.ascontiguousarray(triangles).reshape(-1, 3), *sides, enough, steps

    def work(begin: int, end: int) -> None:
        rows = kernels.DEEPEST + 1
        numbers = np.zeros((9 * rows + 3, kernels.WIDTH))
        whole = np.zeros((8 + 3 * rows, kernels.WIDTH), dtype=np.int64)
        ordinates = np.zeros(net.shape[1])
        kernels.measure_faces(*read, *rings, *asked, begin, end, numbers, ordinates, whole, made)

    levels.blocks.quiet().run(len(faces), work)
    # Where fans of several kinds meet, or of very many faces.
    rows = np.flatnonzero(made[:, UNKNOWN])
    if len(rows):
        about = triangles.reshape(-1, 3, 3)[rows]
        made[rows, :UNKNOWN] = _hulls(part, mesh.faces[faces[rows]], about, sides[1][rows])
    return made


def _hulls(
    part: Part,
    corners: Integer[np.ndarray, "N 3"],
    triangles: Float[np.ndarray, "N 3 3"],
    fenced: Bool[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 3"]:
    """Return slabs of faces by all control points around their corners."""
    ends = part.topology.edges.astype(np.int64)
    ends = ends[marked(corners, part.topology.vertex_count)[ends].any(axis=1)]
    ends = np.concatenate([ends, ends[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    flat = corners.reshape(-1).astype(np.int64)
    begin, end = (np.searchsorted(ends[:, 0], flat, side=side) for side in ("left", "right"))
    counts = end - begin
    at = ranges(begin, counts)
    face = np.repeat(np.arange(len(flat)) // 3, counts)
    to = part.points[ends[at, 1]] - triangles[face, 0]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.where(lengths > 0, lengths, 1.0)[:, None]
    heights, made = np.einsum("ij,ij->i", to, normals[face]), np.zeros((len(corners), 3))
    np.minimum.at(made[:, LOW], face, heights)
    np.maximum.at(made[:, HIGH], face, heights)
    # No plane, or a side: a corner of it is not farther than what is around any of the corners.
    away = np.zeros(len(corners))
    for corner in range(3):
        reach = np.linalg.norm(to + triangles[face, 0] - triangles[face, corner], axis=1)
        np.maximum.at(away, face, reach)
    made[:, HIGH] = np.where(lengths > 0, made[:, HIGH], away)
    made[:, SIDE] = np.where(fenced.any(axis=1), away, 0.0)
    return made
