"""Features of edges for the sharpness network (docs/reference/features.md).

The turn of an edge is t = ± sin(θ/2), θ the angle between its faces' normals: positive at ridges,
0 beside faces without area and at edges without two faces. Columns of signed turns are multiplied
by the sign of the edge's own turn. What is measured at each end, or on each side, fills two columns
in ascending order, so that neither has a say.
"""

from __future__ import annotations

import math

from pns_common.kernels import (
    f8_1d,
    f8_2d,
    i1_1d,
    i4_1d,
    i4_2d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import INTERIOR, following_corner, preceding_corner
from pns_common.kernels.frames import wing
from pns_common.kernels.vectors import between, difference, dot, norm, root, row

# Turns are counted by ramps between each pair of angles: about 15, 30, 50 and 66 degrees.
RAMPS = tuple(
    (math.sin(math.radians(angle - 5) / 2), math.sin(math.radians(angle + 5) / 2))
    for angle in (15, 30, 50, 66)
)
STEPS = len(RAMPS)
# Columns of a vertex: counts above each ramp, sum of |t|, sum of lengths; the two largest turns up
# and down, then the three largest either way.
SIZE, LENGTH, UP, DOWN, LARGEST, COLUMNS = STEPS, STEPS + 1, STEPS + 2, STEPS + 4, STEPS + 6, 13
# Edges at a vertex that has more are continued by none, so that no hub costs its valence squared.
MOST_SPOKES = 64
# In a face of more corners an edge's wing edges are not the sides beside it, which around a cap are
# as sharp as it is, but those of a triangle of the edge and the mean of the other corners.
MOST_WINGED = 4
# Sums of weights below this count as no edge.
LEAST_WEIGHT = 0.05
# Logarithms of ratios are cut off here, and counts of edges.
LARGEST_LOG, MOST_COUNTED = 4.0, 4.0
# Columns of features: |t|, x; turns of the wing edges, and how many of these have no two faces;
# log (length / mean length); then pairs of sides and pairs of ends.
OWN, JUMP, WINGS, OPEN, SCALE, SIDES = 0, 1, 2, 6, 7, 8
SIDE_PAIRS, RING_PAIRS, CONTINUATION_PAIRS = 4, 10, 6
ENDS = SIDES + 2 * SIDE_PAIRS
# These comparisons bring four columns into order.
WING_ORDER = (0, 1), (2, 3), (0, 2), (1, 3), (1, 2)
LOCAL = ENDS + 2 * (RING_PAIRS + CONTINUATION_PAIRS)


@inlined
def _ramp(value, low, high):
    """Return 0 below ``low``, 1 above ``high``, and a straight line between them."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


@inlined
def _share(value, other):
    """Return value / (value + other), of numbers ≥ 0; 0 where both are 0."""
    return value / (value + other) if value + other > 0 else 0.0


@inlined
def _log(value, by):
    """Return log (value / by), at most 4 either way; 0 where both are 0."""
    least = math.exp(-LARGEST_LOG)
    if value <= least * by:
        return -LARGEST_LOG if by > 0 else 0.0
    return min(math.log(value / by), LARGEST_LOG) if by > 0 else LARGEST_LOG


@kernel
def signed_turns(jumps: f8_1d, bends: f8_1d, begin: int, end: int, turns: f8_1d):
    """Write the turns t of edges begin … end − 1."""
    for e in range(max(begin, 0), end):
        turns[e] = math.copysign(root(jumps[e] / 2), bends[e])


@kernel
def find_spokes(edges: u4_2d, stops: i8_1d, spokes: u4_1d):
    """Write the edges at vertex 0, 1, …, one after another.

    Args:
        stops: (V,) where those of each vertex begin; on return, where they end.
        spokes: (2 E,) out.
    """
    for e in range(edges.shape[0]):
        for side in range(2):
            v = edges[e, side]
            spokes[stops[v]] = e
            stops[v] += 1


@inlined
def _keep_largest(columns, v, first, count, value):
    """Put a value in its place among the largest at a vertex, in descending order."""
    for k in range(first, first + count):
        if value > columns[v, k]:
            columns[v, k], value = value, columns[v, k]


@kernel
def measure_turns(
    turns: f8_1d, lengths: f8_1d, starts: i8_1d, spokes: u4_1d, begin: int, end: int, columns: f8_2d
):
    """Write ``columns`` (V, COLUMNS) of vertices begin … end − 1."""
    for v in range(max(begin, 0), end):
        for k in range(COLUMNS):
            columns[v, k] = 0.0
        for i in range(starts[v], starts[v + 1]):
            e = spokes[i]
            size = abs(turns[e])
            for k in range(STEPS):
                columns[v, k] += _ramp(size, RAMPS[k][0], RAMPS[k][1])
            columns[v, SIZE] += size
            columns[v, LENGTH] += lengths[e]
            _keep_largest(columns, v, UP, 2, turns[e])
            _keep_largest(columns, v, DOWN, 2, -turns[e])
            _keep_largest(columns, v, LARGEST, 3, size)


@inlined
def _write_side(e, h, side, sign, points, turns, lengths, areas, mesh, to):
    """Write what is measured on one side of edge e, in the face of half-edge h, to a row."""
    corners, offsets, face_of_corner, corner_edges, edge_class = mesh
    beyond = following_corner(h, offsets, face_of_corner)
    before, after = corner_edges[preceding_corner(h, offsets, face_of_corner)], corner_edges[beyond]
    f = face_of_corner[h] if len(face_of_corner) else h // 3
    count = offsets[f + 1] - offsets[f]
    if count > MOST_WINGED:
        x, y, z, _ = wing(points, h, corners, offsets, face_of_corner)
        back, ahead = 0.0, 0.0
        first = norm(difference((x, y, z), row(points, corners[h])))
        second = norm(difference((x, y, z), row(points, corners[beyond])))
    else:
        back, ahead = turns[before], turns[after]
        first, second = lengths[before], lengths[after]
        to[OPEN] += ((edge_class[before] != INTERIOR) + (edge_class[after] != INTERIOR)) / 4
    # Of a triangle its height over e, times the length of e.
    height = areas[f] / (count - 2)
    both, square = first + second, lengths[e] * lengths[e]
    to[WINGS + 2 * side], to[WINGS + 2 * side + 1] = sign * back, sign * ahead
    at = SIDES + side
    to[at] = max(abs(back), abs(ahead))
    to[at + 2] = _share(height, square)
    to[at + 4] = _log(both, 2 * lengths[e])
    to[at + 6] = abs(first - second) / both if both > 0 else 0.0


@inlined
def _write_ring(e, v, side, sign, turns, lengths, columns, valence, to):
    """Write what is measured of the other edges at the end v of edge e to a row."""
    own, at = abs(turns[e]), ENDS + side
    for k in range(STEPS):
        count = columns[v, k] - _ramp(own, RAMPS[k][0], RAMPS[k][1])
        to[at + 2 * k] = min(max(count, 0.0), MOST_COUNTED) / MOST_COUNTED
    to[at + 8] = max(columns[v, SIZE] - own, 0.0) / max(valence - 1, 1)
    to[at + 10] = _log(valence, 6.0)
    to[at + 12] = _log(lengths[e], columns[v, LENGTH] / valence)
    # The largest turn the same way and the other way, and the second largest of both.
    like, unlike = (UP, DOWN) if sign > 0 else (DOWN, UP)
    to[at + 14] = columns[v, like + 1 if own >= columns[v, like] else like]
    to[at + 16] = columns[v, unlike]
    to[at + 18] = columns[v, LARGEST + 2 if own >= columns[v, LARGEST + 1] else LARGEST + 1]


@inlined
def _write_continuation(e, v, side, sign, points, edges, edge_class, turns, starts, spokes, to):
    """Write how edge e goes on at its end v to a row: 0 where it does not."""
    straightest, ridge, way_out, branch = 0.0, 0.0, 0.0, 0.0
    weights, turned, sharp_weights, sharp_cosines = 0.0, 0.0, 0.0, 0.0
    along = between(points, _other_end(edges, e, v), v)
    size, count = norm(along), starts[v + 1] - starts[v]
    for j in range(starts[v], starts[v + 1] if count <= MOST_SPOKES else starts[v]):
        other = spokes[j]
        spoke = between(points, v, _other_end(edges, other, v))
        scale = size * norm(spoke)
        if other == e or not scale > 0:
            continue
        cosine, turn = min(max(dot(along, spoke) / scale, -1.0), 1.0), sign * turns[other]
        straight, sharp = max(cosine, 0.0) ** 4, turn**4
        straightest, ridge = max(straightest, cosine), max(ridge, straight * turn)
        branch = max(branch, (1 - straight) * abs(turn))
        if edge_class[other] != INTERIOR:
            way_out = max(way_out, straight)
        weights += straight**2
        turned += straight**2 * turn
        sharp_weights += sharp
        sharp_cosines += sharp * cosine
    at = ENDS + 2 * RING_PAIRS + side
    to[at], to[at + 2], to[at + 4], to[at + 6] = straightest, ridge, way_out, branch
    # The turn of what goes straight on, and whether what is sharp goes straight on.
    to[at + 8] = turned / max(weights, LEAST_WEIGHT)
    to[at + 10] = sharp_cosines / max(sharp_weights, LEAST_WEIGHT**4)


@inlined
def _other_end(edges, e, v):
    return edges[e, 1] if edges[e, 0] == v else edges[e, 0]


@inlined
def _ascend(to, i, j):
    """Bring two columns of a row into ascending order."""
    if to[i] > to[j]:
        to[i], to[j] = to[j], to[i]


@kernel
def edge_features(
    points: f8_2d,
    lengths: f8_1d,
    jumps: f8_1d,
    turns: f8_1d,
    areas: f8_1d,
    columns: f8_2d,
    starts: i8_1d,
    spokes: u4_1d,
    corners: u4_1d,
    offsets: i4_1d,
    face_of_corner: u4_1d,
    corner_edges: u4_1d,
    edges: u4_2d,
    half_edges: i4_2d,
    edge_class: i1_1d,
    mean_length: float,
    rows: u4_1d,
    features: f8_2d,
):
    """Write the columns up to LOCAL of interior edges ``rows``.

    Args:
        areas: (F,) twice the areas of the faces.
        columns: (V, COLUMNS) from ``measure_turns``.
        starts, spokes: (V + 1,), (2 E,) edges around vertices.
        mean_length: of all edges.
        features: (N, LOCAL or more) out.
    """
    mesh = corners, offsets, face_of_corner, corner_edges, edge_class
    for i in range(rows.shape[0]):
        e, to = rows[i], features[i]
        sign = 1.0 if turns[e] >= 0 else -1.0
        to[OWN], to[JUMP], to[OPEN] = abs(turns[e]), jumps[e], 0.0
        to[SCALE] = _log(lengths[e], mean_length)
        for side in range(2):
            h = half_edges[e, side]
            _write_side(e, h, side, sign, points, turns, lengths, areas, mesh, to)
            v = edges[e, side]
            valence = starts[v + 1] - starts[v]
            _write_ring(e, v, side, sign, turns, lengths, columns, valence, to)
            _write_continuation(
                e, v, side, sign, points, edges, edge_class, turns, starts, spokes, to
            )
        for first, second in WING_ORDER:
            _ascend(to, WINGS + first, WINGS + second)
        for k in range(SIDES, LOCAL, 2):
            _ascend(to, k, k + 1)
