"""The faces that a split makes: the fold guard's test, normals, turns between them."""

from __future__ import annotations

import math

from pns_common.kernels import Connectivity, b1_1d, f8_1d, f8_2d, inlined, kernel, u4_2d
from pns_common.kernels.connectivity import INTERIOR, following_corner, triangle_of
from pns_common.kernels.vectors import NO_AREA, area_vector, difference, dot, row

# A child that keeps less than this share of its area counts as folded.
LEAST_AREA = 1e-3
# Far more than the rounding of a cosine.
COSINE_MARGIN = 1e-14
# Products above this have all their digits.
NORMAL_NUMBERS = 1e-300


@inlined
def _moved(base, displacement, scale, v):
    """Return where the base scheme puts vertex v, and where it is moved to."""
    p, s = row(base, v), scale[v]
    return p, (
        p[0] + s * displacement[v, 0],
        p[1] + s * displacement[v, 1],
        p[2] + s * displacement[v, 2],
    )


@inlined
def _folds(p, q, r, cosine):
    """Return whether a triangle turned by more than arccos(cosine), or lost its area.

    Each corner is a pair: where the base scheme puts it, and where it is moved to. False for a
    triangle without area before.
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


@kernel
def mark_folds(
    begin: int,
    end: int,
    faces: u4_2d,
    base: f8_2d,
    displacement: f8_2d,
    scale: f8_1d,
    shared: b1_1d,
    changed: b1_1d,
    cosine: float,
    to: b1_1d,
):
    """Mark the corners of folded children begin … end − 1 whose s is not 0 yet.

    Of a quad the triangles of each corner and its neighbours are tested.

    Args:
        faces: (C, 3) triangles or (C, 4) quads.
        base, displacement, scale: the base scheme's points, δ, s of each new vertex.
        shared: flags of vertices of boundaries, which are marked only if they fold a child while
            all others stay; (0,) for none.
        changed: flags of vertices whose s changed in the last round; other children are as they
            were. (0,): all are tested.
        to: flags, False on entry; threads may write the same True at once.
    """
    degree = faces.shape[1]
    for f in range(max(begin, 0), end):
        if len(changed):
            touched = False
            for i in range(degree):
                touched = touched or changed[faces[f, i]]
            if not touched:
                continue
        u, v = faces[f, 0], faces[f, 1]
        p, q = _moved(base, displacement, scale, u), _moved(base, displacement, scale, v)
        for i in range(degree if degree > 3 else 1):
            w = faces[f, i + 2 if i + 2 < degree else i + 2 - degree]
            r = _moved(base, displacement, scale, w)
            if _folds(p, q, r, cosine):
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
            u, v, p, q = v, w, q, r


@inlined
def _squared_chord(normals, f, g):
    """Return the squared distance between two unit normals; 0 where one is undefined."""
    n, m = row(normals, f), row(normals, g)
    chord = difference(n, m)
    return dot(chord, chord) if dot(n, n) > 0 and dot(m, m) > 0 else 0.0


@kernel
def largest_chord_inside(begin: int, end: int, mesh: Connectivity, quads: bool, normals: f8_2d):
    """Return the largest squared chord between neighbours among the children of some faces.

    ``quads``: whether corners become quads, which are in a ring; else three triangles are around a
    fourth.
    """
    largest = 0.0
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        for h in range(first, stop):
            if quads:
                chord = _squared_chord(normals, h - 1 if h > first else stop - 1, h)
            else:
                chord = _squared_chord(normals, 4 * f + 3, h + f)
            largest = max(largest, chord)
    return largest


@inlined
def _child_of(h, quads):
    """Return the child at a corner."""
    return h if quads else h + triangle_of(h)


@kernel
def largest_chord_across(begin: int, end: int, mesh: Connectivity, quads: bool, normals: f8_2d):
    """Return the largest squared chord across the halves of interior edges begin … end − 1."""
    largest = 0.0
    for e in range(max(begin, 0), end):
        if mesh.edge_class[e] == INTERIOR:
            there, back = mesh.half_edges[e, 0], mesh.half_edges[e, 1]
            for h, g in ((there, back), (back, there)):
                other = _child_of(following_corner(mesh, g), quads)
                largest = max(largest, _squared_chord(normals, _child_of(h, quads), other))
    return largest
