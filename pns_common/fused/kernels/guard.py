"""The fold guard over the children of faces, with the decisions of fold_guard.py."""

from __future__ import annotations

import math

from pns_common.formula.fold_guard import LEAST_AREA
from pns_common.fused.kernels.compiled import (
    FLAGS,
    FLAGS_OUT,
    INDICES,
    NUMBERS,
    POINTS,
    REAL,
    SIZE,
    kernel,
)
from pns_common.fused.kernels.normals import COSINE_MARGIN, clearly_less
from pns_common.fused.kernels.rings import cross, dot, row
from pns_common.geometry.frames import NO_AREA


def _moved(p, displacement, scale, v):
    return _by_share(p, displacement, v, scale[v] if len(scale) else 1.0)


def _by_share(p, displacement, v, s):
    return (
        p[0] + s * displacement[v, 0],
        p[1] + s * displacement[v, 1],
        p[2] + s * displacement[v, 2],
    )


def _difference(p, q):
    return q[0] - p[0], q[1] - p[1], q[2] - p[2]


def _turned(a, b, c, moved_a, moved_b, moved_c, cosine, clear):
    """Return whether a face turned or shrank too much; False if it had no area (``turned``).

    ``clear`` is a bound for ``clearly_less``: no root need be taken where the angle is clear.
    """
    u, v = _difference(a, b), _difference(a, c)
    old, new = cross(u, v), cross(_difference(moved_a, moved_b), _difference(moved_a, moved_c))
    old_square, new_square = dot(old, old), dot(new, new)
    shrunk = not new_square >= LEAST_AREA**2 * old_square
    # Whether it had an area or not: most faces end here.
    if not shrunk and clearly_less((*old, old_square), (*new, new_square), clear):
        return False
    least = NO_AREA * (dot(u, u) + dot(v, v))
    if not old_square > least * least:
        return False
    size = math.sqrt(old_square) * math.sqrt(new_square)
    return shrunk or not dot(old, new) >= cosine * size


def _by_itself(p, displacement, scale, shared, v):
    """Return where a vertex is while none moves but the shared ones."""
    if shared[v]:
        return _moved(p, displacement, scale, v)
    return _by_share(p, displacement, v, 0.0)


@kernel(
    SIZE,
    *(POINTS, POINTS, NUMBERS, FLAGS, REAL, INDICES, INDICES, SIZE, FLAGS, SIZE, SIZE, FLAGS_OUT),
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
    touched,
):
    """Mark the corners of folded children of faces begin … end − 1 whose s is not 0 yet.

    Args:
        scale: s of each vertex; empty where it is 1 everywhere.
        shared: vertices that are marked only if they fold the child by themselves; empty for none.
        changed: vertices whose s changed in the last round: other faces are as they were. Empty in
            the first round.
        touched: out, False on entry; threads may write the same True at once.
    """
    clear = (cosine + COSINE_MARGIN) * (cosine + COSINE_MARGIN)
    for f in range(begin, end):
        ab = vertex_count + face_edges[f, 0]
        bc = vertex_count + face_edges[f, 1]
        ca = vertex_count + face_edges[f, 2]
        # Three of the four children share each of these.
        p, q, r = row(loop, ab), row(loop, bc), row(loop, ca)
        moved_p = _moved(p, displacement, scale, ab)
        moved_q = _moved(q, displacement, scale, bc)
        moved_r = _moved(r, displacement, scale, ca)
        for i in range(4):
            if i == 3:
                v, a, moved_a = ab, p, moved_p
                s, b, moved_b = bc, q, moved_q
                t, c, moved_c = ca, r, moved_r
            else:
                v = faces[f, i]
                a = row(loop, v)
                moved_a = _moved(a, displacement, scale, v)
                if i == 0:
                    s, b, moved_b, t, c, moved_c = ab, p, moved_p, ca, r, moved_r
                elif i == 1:
                    s, b, moved_b, t, c, moved_c = bc, q, moved_q, ab, p, moved_p
                else:
                    s, b, moved_b, t, c, moved_c = ca, r, moved_r, bc, q, moved_q
            if len(changed) and not (changed[v] or changed[s] or changed[t]):
                continue
            if _turned(a, b, c, moved_a, moved_b, moved_c, cosine, clear):
                by_itself = True
                if len(shared):
                    alone_a = _by_itself(a, displacement, scale, shared, v)
                    alone_b = _by_itself(b, displacement, scale, shared, s)
                    alone_c = _by_itself(c, displacement, scale, shared, t)
                    by_itself = _turned(a, b, c, alone_a, alone_b, alone_c, cosine, clear)
                for w in (v, s, t):
                    if (by_itself or not shared[w]) and (len(scale) == 0 or scale[w] > 0):
                        touched[w] = True
    return 0
