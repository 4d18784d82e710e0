"""The search for the face that is nearest to a point: exact, in a tree of boxes."""

import numpy as np
from numba import njit

from train.metrics.faces.face_boxes import LOWER, MOST_WAITING, UPPER, WIDE
from train.metrics.faces.vectors import between, corner_of, dot


@njit(cache=True, error_model="numpy")
def search(order, corners, boxes, last_level, points, square, place, on_mesh):
    """Look into the nearest boxes first, and into none that is farther than the best face so far.

    Of faces at one distance the lowest is taken, whichever is seen first. The face that is nearest
    to one point is the first that the next point is compared with: often that is the answer, or
    almost.
    """
    node_of, square_of = np.empty(MOST_WAITING, np.int64), np.empty(MOST_WAITING)
    lanes, nearest_face = np.empty(WIDE), 0
    for i in range(len(points)):
        p = points[i, 0], points[i, 1], points[i, 2]
        least, q = _nearest_of(corners, nearest_face, p)
        waiting, node_of[0], square_of[0] = 1, 0, 0.0
        while waiting:
            waiting -= 1
            node = node_of[waiting]
            if square_of[waiting] > least:
                continue
            _measure(boxes, node, p, lanes)
            below = waiting
            for lane in range(WIDE):
                # Empty boxes are infinitely far, also from points beyond all numbers.
                if not lanes[lane] <= least or lanes[lane] == np.inf:
                    continue
                if node < last_level:
                    # The nearest on top.
                    at = waiting
                    while at > below and square_of[at - 1] < lanes[lane]:
                        node_of[at], square_of[at] = node_of[at - 1], square_of[at - 1]
                        at -= 1
                    node_of[at], square_of[at] = WIDE * node + 1 + lane, lanes[lane]
                    waiting += 1
                else:
                    face = WIDE * (node - last_level) + lane
                    here, there = _nearest_of(corners, face, p)
                    lower = order[face] < order[nearest_face]
                    if here < least or (here == least and lower):
                        least, q, nearest_face = here, there, face
        square[i], place[i] = least, nearest_face
        on_mesh[i, 0], on_mesh[i, 1], on_mesh[i, 2] = q


@njit(cache=True)
def _measure(boxes, node, p, lanes):
    """Square the distances of a point from the boxes of a node."""
    for lane in range(WIDE):
        x = _beyond(boxes[node, LOWER, lane], p[0], boxes[node, UPPER, lane])
        y = _beyond(boxes[node, LOWER + 1, lane], p[1], boxes[node, UPPER + 1, lane])
        z = _beyond(boxes[node, LOWER + 2, lane], p[2], boxes[node, UPPER + 2, lane])
        lanes[lane] = x * x + y * y + z * z


@njit(cache=True)
def _beyond(lower, value, upper):
    """Return how far a value is outside its bounds; written so that no jump is needed."""
    under, over = lower - value, value - upper
    outside = under if under > over else over
    return outside if outside > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _nearest_of(corners, face, p):
    """Return the squared distance of a face, and its nearest point (Ericson 2005, 5.1.5)."""
    a, b, c = corner_of(corners, face, 0), corner_of(corners, face, 1), corner_of(corners, face, 2)
    u, v, from_a = between(a, b), between(a, c), between(a, p)
    d1, d2 = dot(u, from_a), dot(v, from_a)
    if d1 <= 0 and d2 <= 0:
        return _squared(p, a)
    from_b = between(b, p)
    d3, d4 = dot(u, from_b), dot(v, from_b)
    if d3 >= 0 and d4 <= d3:
        return _squared(p, b)
    at_c = d1 * d4 - d3 * d2
    if at_c <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        return _squared(p, _along(a, d1 / (d1 - d3), u))
    from_c = between(c, p)
    d5, d6 = dot(u, from_c), dot(v, from_c)
    if d6 >= 0 and d5 <= d6:
        return _squared(p, c)
    at_b = d5 * d2 - d1 * d6
    if at_b <= 0 and d2 >= 0 and d6 <= 0 and d2 > d6:
        return _squared(p, _along(a, d2 / (d2 - d6), v))
    at_a, beyond_b, beyond_c = d3 * d6 - d5 * d4, d4 - d3, d5 - d6
    if at_a <= 0 and beyond_b >= 0 and beyond_c >= 0:
        return _squared(p, _along(b, beyond_b / (beyond_b + beyond_c), between(b, c)))
    share = 1 / (at_a + at_b + at_c)
    return _squared(p, _along(_along(a, at_b * share, u), at_c * share, v))


@njit(cache=True)
def _along(p, share, u):
    return p[0] + share * u[0], p[1] + share * u[1], p[2] + share * u[2]


@njit(cache=True)
def _squared(p, q):
    apart = between(q, p)
    return dot(apart, apart), q
