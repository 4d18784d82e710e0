"""The fold guard over the children of faces, with the decisions of fold_guard.py."""

from __future__ import annotations

import math

from pns_common.formula.fold_guard import LEAST_AREA
from pns_common.fused.kernels.compiled import (
    FLAGS,
    FLAGS_OUT,
    INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    REAL,
    SIZE,
    called_seldom,
    kernel,
    natural,
)
from pns_common.fused.kernels.normals import (
    COSINE_MARGIN,
    area,
    child_corners,
    clearly_less,
)
from pns_common.fused.kernels.together import TOGETHER, keep, kept
from pns_common.fused.kernels.vectors import cross, difference, dot, row
from pns_common.geometry.frames import NO_AREA

# What is held of a face: where Loop puts its corners and the middles of its edges, each with its
# displacement and s.
HELD = 42


def _moved(p, displacement, v, s):
    return (
        p[0] + s * displacement[v, 0],
        p[1] + s * displacement[v, 1],
        p[2] + s * displacement[v, 2],
    )


def _corner(loop, displacement, scale, v):
    """Return where Loop puts a vertex, and where it is moved to."""
    p = row(loop, v)
    return p, _moved(p, displacement, v, scale[v] if len(scale) else 1.0)


def _shared_corner(loop, displacement, scale, shared, v):
    """Return the same while none moves but the shared ones."""
    p, moved = _corner(loop, displacement, scale, v)
    return (p, moved) if shared[v] else (p, _moved(p, displacement, v, 0.0))


def _hold(held, k, lane, loop, displacement, scale, v):
    """Hold where Loop puts a vertex, its displacement, and s where that is not 1 everywhere."""
    keep(held, 7 * k, lane, row(loop, v))
    keep(held, 7 * k + 3, lane, row(displacement, v))
    if len(scale):
        held[(7 * k + 6) * TOGETHER + lane] = scale[v]


def _hold_whole(held):
    """Hold s = 1 of all."""
    for k in range(6):
        for lane in range(TOGETHER):
            held[(7 * k + 6) * TOGETHER + lane] = 1.0


def _held(held, k, lane):
    """Return where Loop puts such a vertex, and where it is moved to."""
    p, d, s = (
        kept(held, 7 * k, lane),
        kept(held, 7 * k + 3, lane),
        held[(7 * k + 6) * TOGETHER + lane],
    )
    return p, (p[0] + s * d[0], p[1] + s * d[1], p[2] + s * d[2])


def _all_stay(held, lane, clear):
    """Return whether all children of a face that is held clearly stay."""
    p, q, r = _held(held, 0, lane), _held(held, 1, lane), _held(held, 2, lane)
    pq, qr, rp = _held(held, 3, lane), _held(held, 4, lane), _held(held, 5, lane)
    stay = _stays(pq, qr, rp, clear) & _stays(p, pq, rp, clear)
    return stay & _stays(q, qr, pq, clear) & _stays(r, rp, qr, clear)


def _stays(a, b, c, clear):
    """Return whether a child clearly neither turned nor shrank too much; False if in doubt.

    ``clear`` is a bound for ``clearly_less``: no root need be taken where the angle is clear.
    """
    old, new = area(a[0], b[0], c[0]), area(a[1], b[1], c[1])
    return (new[3] >= LEAST_AREA**2 * old[3]) & clearly_less(old, new, clear)


def _any_changed(changed, faces, face_edges, middles, first, count):
    """Return whether a corner of the children of some faces is marked."""
    found = False
    for f in range(first, first + count):
        for k in range(3):
            found |= changed[faces[f, k]] | changed[middles + face_edges[f, k]]
    return found


@called_seldom
def _turned(a, b, c, cosine):
    """Return whether a child turned or shrank too much; False if it had no area (``turned``)."""
    u, v = difference(b[0], a[0]), difference(c[0], a[0])
    old, new = cross(u, v), cross(difference(b[1], a[1]), difference(c[1], a[1]))
    old_square, new_square = dot(old, old), dot(new, new)
    least = NO_AREA * (dot(u, u) + dot(v, v))
    if not old_square > least * least:
        return False
    size = math.sqrt(old_square) * math.sqrt(new_square)
    return not new_square >= LEAST_AREA**2 * old_square or not dot(old, new) >= cosine * size


@kernel(
    SIZE,
    *(POINTS, POINTS, NUMBERS, FLAGS, REAL, INDICES, INDICES, SIZE, FLAGS, SIZE, SIZE),
    *(NUMBERS_OUT, FLAGS_OUT),
)
def find_folds(
    loop,
    displacement,
    scale,
    shared,
    cosine,
    faces,
    face_edges,
    vertex_count,
    changed,
    begin,
    end,
    held,
    touched,
):
    """Mark the corners of folded children of faces begin … end − 1 whose s is not 0 yet.

    Args:
        scale: s of each vertex; empty where it is 1 everywhere.
        shared: vertices that are marked only if they fold the child by themselves; empty for none.
        changed: vertices whose s changed in the last round, or that move at all in the first:
            other faces are as they were. Empty: all are looked at.
        held: (HELD TOGETHER,) overwritten.
        touched: out, False on entry; threads may write the same True at once.
    """
    clear = (cosine + COSINE_MARGIN) * (cosine + COSINE_MARGIN)
    moves, middles = (loop, displacement, scale), natural(vertex_count)
    _hold_whole(held)
    for first in range(natural(begin), end, TOGETHER):
        count, doubtful = min(TOGETHER, end - first), 0
        if len(changed) and not _any_changed(changed, faces, face_edges, middles, first, count):
            continue
        for lane in range(TOGETHER):
            f = natural(min(first + lane, end - 1))
            _hold(held, 0, lane, *moves, faces[f, 0])
            _hold(held, 1, lane, *moves, faces[f, 1])
            _hold(held, 2, lane, *moves, faces[f, 2])
            _hold(held, 3, lane, *moves, middles + face_edges[f, 0])
            _hold(held, 4, lane, *moves, middles + face_edges[f, 1])
            _hold(held, 5, lane, *moves, middles + face_edges[f, 2])
        for lane in range(TOGETHER):
            doubtful += not _all_stay(held, lane, clear)
        if doubtful == 0:
            continue
        for f in range(first, first + count):
            for i in range(4):
                u, v, w = child_corners(faces, face_edges, vertex_count, f, i)
                if len(changed) and not (changed[u] or changed[v] or changed[w]):
                    continue
                p, q, r = _corner(*moves, u), _corner(*moves, v), _corner(*moves, w)
                if not _turned(p, q, r, cosine):
                    continue
                by_itself = True
                if len(shared):
                    p = _shared_corner(*moves, shared, u)
                    q = _shared_corner(*moves, shared, v)
                    r = _shared_corner(*moves, shared, w)
                    by_itself = _turned(p, q, r, cosine)
                for corner in (u, v, w):
                    if (by_itself or not shared[corner]) and (len(scale) == 0 or scale[corner] > 0):
                        touched[corner] = True
    return 0
