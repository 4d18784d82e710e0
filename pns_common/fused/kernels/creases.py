"""Crease lines, with the answers of geometry/crease_lines.py."""

from __future__ import annotations

import math

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS,
    FLAGS_OUT,
    INDEX,
    INDEX_OUT,
    INDICES,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.vectors import between, cross, divisor, dot, row
from pns_common.geometry.crease_lines import (
    CORNER,
    ROUNDS,
    TIMES_ITS_OWN,
    TIMES_THEIRS,
    UNEVEN,
    UNEVEN_END,
)

# What an edge beside another is to it.
NEITHER, LIKE, SHARPER = 0, 1, 2
BOTH = 3


def normals_beside(normals, half_edges, edge_class, e):
    """Return the normals of an edge's two faces; of its first one twice where it is not interior.

    It does not branch, so that loops over edges run on vectors.
    """
    first = half_edges[e, 0]
    second = half_edges[e, 1] if edge_class[e] == INTERIOR else first
    return row(normals, first // 3), row(normals, second // 3)


@kernel(SIZE, POINTS, INDICES, CLASSES, REAL, SIZE, SIZE, FLAGS_OUT)
def mark_edges_beyond(normals, half_edges, edge_class, cosine, begin, end, beyond):
    """Mark interior edges begin … end − 1 whose faces' normals have a smaller cosine.

    Faces without a normal are beside none of them. Returns how many there are.
    """
    found = 0
    for e in range(natural(begin), end):
        n, m = normals_beside(normals, half_edges, edge_class, e)
        defined = (dot(n, n) > 0) & (dot(m, m) > 0)
        beyond[e] = (edge_class[e] == INTERIOR) & defined & (dot(n, m) < cosine)
        found += beyond[e]
    return found


def _cosine(normals, half_edges, edge_class, e):
    """Return the cosine of the turn at an edge: 1 where it is not interior, or a normal is none."""
    if edge_class[e] != INTERIOR:
        return 1.0
    n, m = row(normals, half_edges[e, 0] // 3), row(normals, half_edges[e, 1] // 3)
    return dot(n, m) if dot(n, n) > 0 and dot(m, m) > 0 else 1.0


def _half(cosine):
    """Return cos(t / 2) of cos t."""
    return math.sqrt((1 + max(cosine, -1.0)) / 2)


@kernel(SIZE, POINTS, INDICES, INDICES, CLASSES, INDEX, SIZE, SIZE, FLAGS_OUT)
def mark_flat_sides(normals, face_edges, half_edges, edge_class, sharp, begin, end, flat):
    """Mark those of the sharp edges begin … end − 1 both of whose faces are flat on another side.

    That is where another edge of the face turns less than half as much.
    """
    for i in range(natural(begin), end):
        e = sharp[i]
        turn = _cosine(normals, half_edges, edge_class, e)
        flattest = 1.0
        for h in range(2):
            f, flattest_of_face = half_edges[e, h] // 3, -1.0
            for k in range(3):
                side = face_edges[f, k]
                if side != e:
                    cosine = _cosine(normals, half_edges, edge_class, side)
                    flattest_of_face = max(flattest_of_face, cosine)
            flattest = min(flattest, flattest_of_face)
        flat[i] = flattest > _half(turn)
    return 0


def _rises(points, normals, faces, edges, half_edges, e):
    """Return whether an edge's second face rises above its first."""
    a, b, f, g = edges[e, 0], edges[e, 1], half_edges[e, 0] // 3, half_edges[e, 1] // 3
    apart = faces[g, 2]
    for k in range(2):
        corner = faces[g, 1 - k]
        if corner != a and corner != b:
            apart = corner
    return dot(row(normals, f), between(points, a, apart)) > 0


def _beside(points, normals, faces, edges, half_edges, edge_class, parallel, e, turn, other):
    """Return what another edge is to an edge whose turn has this cosine."""
    if other == e or edge_class[other] != INTERIOR:
        return NEITHER
    bend, its_bend = 1 - turn, 1 - _cosine(normals, half_edges, edge_class, other)
    sharper = its_bend > TIMES_ITS_OWN * bend
    if not (sharper or bend <= TIMES_THEIRS * its_bend):
        return NEITHER
    own = between(points, edges[e, 0], edges[e, 1])
    its = between(points, edges[other, 0], edges[other, 1])
    along = dot(its, own)
    if not along * along >= parallel * (dot(its, its) * dot(own, own)):
        return NEITHER
    a, b, c, d = edges[e, 0], edges[e, 1], edges[other, 0], edges[other, 1]
    if ((a == c or b == d) and along < 0) or ((a == d or b == c) and along > 0):
        return NEITHER  # it goes on from this one's end
    if sharper:
        return SHARPER
    rises = _rises(points, normals, faces, edges, half_edges, e)
    return LIKE if _rises(points, normals, faces, edges, half_edges, other) == rises else NEITHER


def _area_square(points, faces, f):
    """Return four times the square of a face's area."""
    area = cross(
        between(points, faces[f, 0], faces[f, 1]), between(points, faces[f, 0], faces[f, 2])
    )
    return dot(area, area)


def _as_wide(first, second, times):
    """Return whether neither of two faces is so many times as wide, of the squares of areas."""
    most = times * times
    return first <= most * second and second <= most * first


@kernel(
    SIZE,
    *(POINTS, POINTS, INDICES, INDICES, INDICES, INDICES, CLASSES, REAL, REAL),
    *(INDEX, SIZE, SIZE, FLAGS_OUT),
)
def mark_alone(
    points,
    normals,
    faces,
    edges,
    face_edges,
    half_edges,
    edge_class,
    parallel,
    row_cosine,
    flat,
    begin,
    end,
    alone,
):
    """Mark those of the edges begin … end − 1 that turn far, or are in no row.

    On a side are the edges of its face, and of the faces across those of them that turn less than
    half as much. ``parallel`` is the square of the least cosine between edges.
    """
    shape = points, normals, faces, edges, half_edges, edge_class, parallel
    for i in range(natural(begin), end):
        e = flat[i]
        turn = _cosine(normals, half_edges, edge_class, e)
        like, sharper = 0, 0  # a bit for each side
        for h in range(2):
            f = half_edges[e, h] // 3
            for k in range(3):
                side = face_edges[f, k]
                found = _beside(*shape, e, turn, side)
                like |= (found == LIKE) << h
                sharper |= (found == SHARPER) << h
                if side == e or edge_class[side] != INTERIOR:
                    continue
                if not _cosine(normals, half_edges, edge_class, side) > _half(turn):
                    continue
                first = half_edges[side, 0] // 3
                beyond = half_edges[side, 1] // 3 if first == f else first
                for m in range(3):
                    found = _beside(*shape, e, turn, face_edges[beyond, m])
                    like |= (found == LIKE) << h
                    sharper |= (found == SHARPER) << h
        first = _area_square(points, faces, half_edges[e, 0] // 3)
        second = _area_square(points, faces, half_edges[e, 1] // 3)
        in_row = like == BOTH and _as_wide(first, second, UNEVEN)
        meets = (like & 1 and sharper & 2) or (like & 2 and sharper & 1)
        ends = meets and _as_wide(first, second, UNEVEN_END)
        alone[i] = turn < row_cosine or not (in_row or ends)
    return 0


@kernel(SIZE, POINTS, INDICES, INDEX, FLAGS, REAL, INDEX_OUT, POINTS_OUT, FLAGS_OUT)
def drop_loose_ends(points, edges, flat, at_rim, cosine, count, total, left):
    """Mark the edges ``flat`` that are left when those are dropped that do not go on at both ends.

    Args:
        at_rim: (V,) where a line may end.
        count: (V,) 0 on entry and exit: how many lines meet at a vertex.
        total: (V, 3) likewise: the sum of their directions away from there.
        left: (N,) True on entry.
    """
    for _ in range(ROUNDS):
        dropped = 0
        for i in range(len(flat)):
            if left[i]:
                a, b = edges[flat[i], 0], edges[flat[i], 1]
                v = between(points, a, b)
                size = divisor(v)
                count[a] += 1
                count[b] += 1
                for k in range(3):
                    total[a, k] += v[k] / size
                    total[b, k] -= v[k] / size
        for i in range(len(flat)):
            if left[i]:
                a, b = edges[flat[i], 0], edges[flat[i], 1]
                if not (
                    _goes_on(at_rim, count, total, a, cosine)
                    and _goes_on(at_rim, count, total, b, cosine)
                ):
                    left[i] = False
                    dropped += 1
        for i in range(len(flat)):
            for end in range(2):
                v = edges[flat[i], end]
                count[v] = 0
                for k in range(3):
                    total[v, k] = 0.0
        if dropped == 0:
            break
    return 0


def _goes_on(at_rim, count, total, v, cosine):
    """Return whether a line goes on at a vertex, or may end there."""
    away = row(total, v)
    straight = count[v] == 2 and dot(away, away) < 2 - 2 * cosine
    return at_rim[v] or straight or count[v] >= CORNER
