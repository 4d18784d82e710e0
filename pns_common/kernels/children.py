"""The triangles of a split: the fold guard's test, normals, turns across edges."""

from __future__ import annotations

import math

from pns_common.kernels import (
    b1_1d,
    f8_1d,
    f8_2d,
    i1_1d,
    i4_2d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import INTERIOR, triangle_of
from pns_common.kernels.vectors import (
    NO_AREA,
    area_vector,
    difference,
    dot,
    normal_and_area,
    row,
)

# A child that keeps less than this share of its area counts as folded.
LEAST_AREA = 1e-3
# Far more than the rounding of a cosine.
COSINE_MARGIN = 1e-14
# Products above this have all their digits.
NORMAL_NUMBERS = 1e-300


@inlined
def child_corners(faces, face_edges, vertex_count, f, i):
    """Return the corners of triangle f's child at corner i; of the middle one for i = 3."""
    ab, bc = vertex_count + face_edges[f, 0], vertex_count + face_edges[f, 1]
    ca = vertex_count + face_edges[f, 2]
    if i == 0:
        return faces[f, 0], ab, ca
    if i == 1:
        return faces[f, 1], bc, ab
    if i == 2:
        return faces[f, 2], ca, bc
    return ab, bc, ca


@inlined
def moved(loop, displacement, scale, v):
    """Return where Loop puts vertex v, and where it is moved to."""
    p, s = row(loop, v), scale[v]
    return p, (
        p[0] + s * displacement[v, 0],
        p[1] + s * displacement[v, 1],
        p[2] + s * displacement[v, 2],
    )


@inlined
def _folds(p, q, r, cosine):
    """Return whether a child turned by more than arccos(cosine), or lost its area.

    Each corner is a pair: where Loop puts it, and where it is moved to. False for a child without
    area before.
    """
    old, new = area_vector(p[0], q[0], r[0]), area_vector(p[1], q[1], r[1])
    old_square, new_square, inner = dot(old, old), dot(new, new), dot(old, new)
    kept_area = new_square >= LEAST_AREA**2 * old_square
    # Squares decide where they are clear, so that no root need be taken.
    squares, clear = old_square * new_square, (cosine + COSINE_MARGIN) * (cosine + COSINE_MARGIN)
    if kept_area and inner > 0 and squares > NORMAL_NUMBERS and inner * inner > clear * squares:
        return False
    u, v = difference(q[0], p[0]), difference(r[0], p[0])
    least = NO_AREA * (dot(u, u) + dot(v, v))
    if not old_square > least * least:
        return False
    size = math.sqrt(old_square) * math.sqrt(new_square)
    return not kept_area or not inner >= cosine * size


@inlined
def mark_fold(p, q, r, u, v, w, scale, shared, cosine, to):
    """Mark the corners u, v, w of a child if it folds, where s is not 0 yet."""
    if not _folds(p, q, r, cosine):
        return
    by_itself = True
    if len(shared):
        by_itself = _folds(
            p if shared[u] else (p[0], p[0]),
            q if shared[v] else (q[0], q[0]),
            r if shared[w] else (r[0], r[0]),
            cosine,
        )
    for corner in (u, v, w):
        if scale[corner] > 0 and (by_itself or not shared[corner]):
            to[corner] = True


@kernel
def mark_folds(
    loop: f8_2d,
    displacement: f8_2d,
    scale: f8_1d,
    shared: b1_1d,
    changed: b1_1d,
    cosine: float,
    faces: u4_2d,
    face_edges: u4_2d,
    vertex_count: int,
    begin: int,
    end: int,
    to: b1_1d,
):
    """Mark the corners of folded children of triangles begin … end − 1 whose s is not 0 yet.

    Args:
        loop, displacement, scale: Loop's points, δ, s of each new vertex.
        shared: flags of vertices of boundaries, which are marked only if they fold a child while
            all others stay; (0,) for none.
        changed: flags of vertices whose s changed in the last round; other children are as they
            were. (0,): all are tested.
        to: flags, False on entry; threads may write the same True at once.
    """
    for f in range(max(begin, 0), end):
        for i in range(4):
            u, v, w = child_corners(faces, face_edges, vertex_count, f, i)
            if len(changed) and not (changed[u] or changed[v] or changed[w]):
                continue
            p, q = moved(loop, displacement, scale, u), moved(loop, displacement, scale, v)
            mark_fold(p, q, moved(loop, displacement, scale, w), u, v, w, scale, shared, cosine, to)


@kernel
def child_normals(
    points: f8_2d,
    faces: u4_2d,
    face_edges: u4_2d,
    vertex_count: int,
    begin: int,
    end: int,
    normals: f8_2d,
):
    """Write the unit normals of the children 4 f … 4 f + 3 of triangles begin … end − 1."""
    for f in range(max(begin, 0), end):
        for i in range(4):
            a, b, c = child_corners(faces, face_edges, vertex_count, f, i)
            normal, _, _ = normal_and_area(row(points, a), row(points, b), row(points, c))
            for k in range(3):
                normals[4 * f + i, k] = normal[k]


@inlined
def squared_chord(normals, f, g):
    """Return the squared distance between two unit normals; 0 where one is undefined."""
    n, m = row(normals, f), row(normals, g)
    chord = difference(n, m)
    return dot(chord, chord) if dot(n, n) > 0 and dot(m, m) > 0 else 0.0


@inlined
def _following(h):
    """Return the child at the corner where half-edge h ends."""
    f = triangle_of(h)
    i = h - 3 * f
    return 4 * f + (i + 1 if i < 2 else 0)


@inlined
def _starting(h):
    """Return the child at the corner where half-edge h starts."""
    f = triangle_of(h)
    return 4 * f + h - 3 * f


@kernel
def largest_chord_inside(normals: f8_2d, begin: int, end: int):
    """Return the largest squared chord between a middle child and its neighbours."""
    largest = 0.0
    for f in range(max(begin, 0), end):
        for i in range(3):
            largest = max(largest, squared_chord(normals, 4 * f + 3, 4 * f + i))
    return largest


@kernel
def largest_chord_across(
    normals: f8_2d, half_edges: i4_2d, edge_class: i1_1d, begin: int, end: int
):
    """Return the largest squared chord across the halves of interior edges begin … end − 1."""
    largest = 0.0
    for e in range(max(begin, 0), end):
        if edge_class[e] == INTERIOR:
            there, back = half_edges[e, 0], half_edges[e, 1]
            largest = max(largest, squared_chord(normals, _starting(there), _following(back)))
            largest = max(largest, squared_chord(normals, _following(there), _starting(back)))
    return largest


@kernel
def opposed_normals(normals: f8_2d, others: f8_2d, begin: int, end: int):
    """Count the rows whose normals oppose each other."""
    count = 0
    for f in range(max(begin, 0), end):
        count += dot(row(normals, f), row(others, f)) < 0
    return count


@kernel
def referenced_sum(points: f8_2d, corners: i8_1d | u4_1d, used: b1_1d, total: f8_1d):
    """Mark the referenced vertices in ``used``; return their number, write their sum."""
    for h in range(corners.shape[0]):
        used[corners[h]] = True
    count = 0
    for v in range(points.shape[0]):
        if used[v]:
            count += 1
            for k in range(3):
                total[k] += points[v, k]
    return count


@kernel
def farthest(points: f8_2d, used: b1_1d, centre: f8_1d):
    """Return the largest distance of a marked vertex from ``centre``."""
    largest = 0.0
    for v in range(points.shape[0]):
        if used[v]:
            away = difference(row(points, v), (centre[0], centre[1], centre[2]))
            largest = max(largest, dot(away, away))
    return math.sqrt(largest)
