"""Normals of the children of faces and the angles between them, with child_faces.py's bits.

What decides is compared without a root or a division wherever that is safe, by area vectors; only
what may be the largest angle, or may be a flipped face, is computed as it is there.
"""

from __future__ import annotations

from pns_common.fused.kernels.children import corner_after, corner_before
from pns_common.fused.kernels.compiled import (
    CLASSES,
    INDICES,
    NUMBERS_OUT,
    POINTS,
    REAL,
    SIZE,
    called_seldom,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.together import TOGETHER, keep, kept
from pns_common.fused.kernels.vectors import cross, difference, dot, norm, row
from pns_common.geometry.frames import NO_AREA

# Far more than the cosine of two computed area vectors is wrong by, and what it counts for.
COSINE_MARGIN = 1e-14
CLEARLY_SAME_SIDE = 1e-20
# Products above this have all their digits.
NORMAL_NUMBERS = 1e-300
# What is held of a face: its corners and the middles of its edges; the far corners of the children
# across each edge, by its start and by where it ends; and 1 where nothing is across, else 0.
CORNERS, MIDDLES, FAR, LONE, HELD = 0, 9, 18, 36, 39


def unit_normal(points, a, b, c):
    """Return a triangle's unit normal; zeros where it has no area (``frames.triangle_normals``)."""
    normal, _, _ = normal_and_area(row(points, a), row(points, b), row(points, c))
    return normal


def normal_and_area(p, q, r):
    """Return the same of three points, twice the area vector, and the length of that."""
    u, v = difference(q, p), difference(r, p)
    vector = cross(u, v)
    square, length = dot(vector, vector), norm(vector)
    shortest = NO_AREA * (dot(u, u) + dot(v, v))
    if square > shortest * shortest:
        return (vector[0] / length, vector[1] / length, vector[2] / length), vector, length
    return (0.0, 0.0, 0.0), vector, length


def squared_chord(n, m):
    """Return the squared distance between two unit normals; 0 where one is undefined."""
    chord = difference(n, m)
    return dot(chord, chord) if dot(n, n) > 0 and dot(m, m) > 0 else 0.0


def child_corners(faces, face_edges, vertex_count, f, i):
    """Return the corners of face f's child at corner i; of the one in the middle for i = 3."""
    if i == 3:
        first, second, third = face_edges[f, 0], face_edges[f, 1], face_edges[f, 2]
        return vertex_count + first, vertex_count + second, vertex_count + third
    leaving, entering = face_edges[f, i], face_edges[f, corner_before(i)]
    return faces[f, i], vertex_count + leaving, vertex_count + entering


@called_seldom
def _child_normal(points, vertex_count, faces, face_edges, f, i):
    """Return the normal of the child at corner i; of the one in the middle for i = 3."""
    a, b, c = child_corners(faces, face_edges, vertex_count, f, i)
    return unit_normal(points, a, b, c)


def area(p, q, r):
    """Return twice the area vector of a triangle, and its square."""
    vector = cross(difference(q, p), difference(r, p))
    return vector[0], vector[1], vector[2], dot(vector, vector)


def clearly_less(n, m, bound):
    """Return whether the angle of area vectors has a cosine above √bound; False if in doubt.

    It does not branch, so that loops of it alone run on vectors.
    """
    inner, squares = dot(n, m), n[3] * m[3]
    return (inner > 0) & (squares > NORMAL_NUMBERS) & (inner * inner > bound * squares)


def _bound(chord):
    """Return what ``clearly_less`` takes for angles below that of a squared chord."""
    cosine = max(1 - chord / 2 + COSINE_MARGIN, 0.0)
    return cosine * cosine


@called_seldom
def _chord_inside(points, vertex_count, faces, face_edges, f):
    """Return the largest squared chord between face f's middle child and its others."""
    centre, largest = _child_normal(points, vertex_count, faces, face_edges, f, 3), 0.0
    for i in range(3):
        corner = _child_normal(points, vertex_count, faces, face_edges, f, i)
        largest = max(largest, squared_chord(centre, corner))
    return largest


@called_seldom
def _chord_across(points, vertex_count, faces, face_edges, f, i, g, j):
    """Return the larger squared chord across an edge: face f's at corner i, g's at corner j."""
    return max(
        squared_chord(
            _child_normal(points, vertex_count, faces, face_edges, f, i),
            _child_normal(points, vertex_count, faces, face_edges, g, corner_after(j)),
        ),
        squared_chord(
            _child_normal(points, vertex_count, faces, face_edges, f, corner_after(i)),
            _child_normal(points, vertex_count, faces, face_edges, g, j),
        ),
    )


def _across(half_edges, edge_class, e, h):
    """Return the other half-edge of an interior edge; h, the one that is known, of any other."""
    other = half_edges[e, 1] if half_edges[e, 0] == h else half_edges[e, 0]
    return other if edge_class[e] == INTERIOR else h


@called_seldom
def _chord_of_face(points, faces, face_edges, half_edges, edge_class, vertex_count, f):
    """Return the largest squared chord inside face f and across its interior edges."""
    largest = _chord_inside(points, vertex_count, faces, face_edges, f)
    for i in range(3):
        h = _across(half_edges, edge_class, face_edges[f, i], 3 * f + i)
        if h != 3 * f + i:
            g = h // 3
            chord = _chord_across(points, vertex_count, faces, face_edges, f, i, g, h - 3 * g)
            largest = max(largest, chord)
    return largest


def _hold_side(points, faces, face_edges, half_edges, edge_class, vertex_count, f, i, lane, held):
    """Hold corner i of face f, the edge that leaves it, and what is across."""
    keep(held, CORNERS + 3 * i, lane, row(points, faces[f, i]))
    keep(held, MIDDLES + 3 * i, lane, row(points, vertex_count + face_edges[f, i]))
    h = _across(half_edges, edge_class, face_edges[f, i], 3 * f + i)
    g = h // 3
    j = h - 3 * g
    # The other face runs along the edge in the opposite direction.
    by_start = row(points, vertex_count + face_edges[g, corner_after(j)])
    by_stop = row(points, vertex_count + face_edges[g, corner_before(j)])
    keep(held, FAR + 6 * i, lane, by_start)
    keep(held, FAR + 6 * i + 3, lane, by_stop)
    held[(LONE + i) * TOGETHER + lane] = 1.0 if h == 3 * f + i else 0.0


def _hold(points, faces, face_edges, half_edges, edge_class, vertex_count, f, lane, held):
    """Hold what the children of face f, and those across its edges, are made of."""
    around = points, faces, face_edges, half_edges, edge_class, vertex_count
    _hold_side(*around, f, 0, lane, held)
    _hold_side(*around, f, 1, lane, held)
    _hold_side(*around, f, 2, lane, held)


def _is_clear_across(held, lane, i, ends, areas, bound):
    """Return whether the children at an edge of a face clearly turn less from those across it.

    ``ends`` are where the edge starts, its middle, and where it ends; ``areas`` those of the
    children there.
    """
    start, middle, stop = ends
    by_start, by_stop = kept(held, FAR + 6 * i, lane), kept(held, FAR + 6 * i + 3, lane)
    at_start = clearly_less(areas[0], area(start, by_start, middle), bound)
    at_stop = clearly_less(areas[1], area(stop, middle, by_stop), bound)
    return (at_start & at_stop) | (held[(LONE + i) * TOGETHER + lane] > 0)


def _is_clear(held, lane, bound):
    """Return whether all children of a face clearly turn less from each other and across edges."""
    a, ab = kept(held, CORNERS, lane), kept(held, MIDDLES, lane)
    b, bc = kept(held, CORNERS + 3, lane), kept(held, MIDDLES + 3, lane)
    c, ca = kept(held, CORNERS + 6, lane), kept(held, MIDDLES + 6, lane)
    centre, at_a = area(ab, bc, ca), area(a, ab, ca)
    at_b, at_c = area(b, bc, ab), area(c, ca, bc)
    clear = clearly_less(centre, at_a, bound) & clearly_less(centre, at_b, bound)
    clear &= clearly_less(centre, at_c, bound)
    clear &= _is_clear_across(held, lane, 0, (a, ab, b), (at_a, at_b), bound)
    clear &= _is_clear_across(held, lane, 1, (b, bc, c), (at_b, at_c), bound)
    return clear & _is_clear_across(held, lane, 2, (c, ca, a), (at_c, at_a), bound)


@kernel(
    REAL,
    *(POINTS, INDICES, INDICES, INDICES, CLASSES, SIZE, SIZE, SIZE),
    *(NUMBERS_OUT, NUMBERS_OUT),
)
def largest_jump(
    points, faces, face_edges, half_edges, edge_class, vertex_count, begin, end, largest_yet, held
):
    """Return the largest squared chord between normals of children of faces begin … end − 1.

    Children are compared inside a face, and across its interior edges.

    Args:
        largest_yet: (1,) in and out: the largest found anywhere. It only spares work: threads may
            overwrite each other's, so the answer is the largest that any call returns.
        held: (HELD TOGETHER,) overwritten.
    """
    largest, bound = 0.0, _bound(largest_yet[0])
    around = faces, face_edges, half_edges, edge_class, natural(vertex_count)
    for first in range(natural(begin), end, TOGETHER):
        count, doubtful = min(TOGETHER, end - first), 0
        for lane in range(count):
            _hold(points, *around, first + lane, lane, held)
        for lane in range(TOGETHER):
            doubtful += (lane < count) & (not _is_clear(held, lane, bound))
        if doubtful == 0:
            continue
        for lane in range(count):
            if not _is_clear(held, lane, bound):
                largest = max(largest, _chord_of_face(points, *around, first + lane))
                largest_yet[0] = max(largest, largest_yet[0])
                bound = _bound(largest_yet[0])
    return largest


@kernel(SIZE, POINTS, POINTS, INDICES, INDICES, SIZE, SIZE, SIZE)
def flipped_children(points, loop_points, faces, face_edges, vertex_count, begin, end):
    """Count the children of faces begin … end − 1 whose normal opposes Loop's."""
    flipped = 0
    for f in range(begin, end):
        for i in range(4):
            a, b, c = child_corners(faces, face_edges, vertex_count, f, i)
            n = area(row(points, a), row(points, b), row(points, c))
            m = area(row(loop_points, a), row(loop_points, b), row(loop_points, c))
            if clearly_less(n, m, CLEARLY_SAME_SIDE):
                continue
            n = _child_normal(points, vertex_count, faces, face_edges, f, i)
            m = _child_normal(loop_points, vertex_count, faces, face_edges, f, i)
            flipped += dot(n, m) < 0
    return flipped
