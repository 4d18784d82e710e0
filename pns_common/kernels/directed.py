"""Directed edges: their features and frames, what they say to each other, and what they answer.

Edge e joins a < b. It stands for two directed edges: 2 e runs a → b, 2 e + 1 runs b → a.
Each has a frame T (along it), N (the mean of both faces' normals, at right angles to T) and
B = N × T; turned round, T and B change their signs. What a missing face would say is 0.
"""

from __future__ import annotations

import math

from pns_common.kernels import (
    Connectivity,
    b1_1d,
    f4_2d,
    f8_1d,
    f8_2d,
    i4_1d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import INTERIOR, IRREGULAR, face_of, opposite
from pns_common.kernels.measures import LENGTH
from pns_common.kernels.vectors import across, cross, difference, divisor, dot, norm, over, row

# Columns of `directed-28`, and of what a directed edge answers: z, y, two logits, a height.
FEATURES = 28
EDGE, VERTEX, SHARPNESS, CORNER, FACE = 0, 3, 6, 7, 8
# Below this length the sum of two normals has no direction: the ends' normals take its place.
NO_MEAN = 1e-3
# Turns, in radians, at which features of the turn saturate; and lengths, in edges.
TURNS, REACH = (0.3, 0.1), 3.0
# Stands for the logarithm of 0.
NO_LOG = -1e300


@inlined
def _sides_of(mesh, e):
    """Return the half-edges of e in the faces left and right of a → b; −1 for none."""
    left, right = -1, -1
    if mesh.edge_class[e] != IRREGULAR:
        for side in range(2):
            h = mesh.half_edges[e, side]
            if h >= 0:
                if mesh.corners[h] == mesh.edges[e, 0]:
                    left = h
                else:
                    right = h
    return left, right


@inlined
def _normal_of(normals, mesh, h):
    """Return the unit normal of the face of a half-edge; 0 without one."""
    return row(normals, face_of(mesh, h)) if h >= 0 else (0.0, 0.0, 0.0)


@inlined
def _sum_of(u, v):
    """Return u + v."""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


@inlined
def _directed_frame(a, b, n, m, at_a, at_b):
    """Return T, N, B and h of a → b; n, m are the faces' normals, at_a and at_b the ends'."""
    spoke = difference(b, a)
    h = norm(spoke)
    t = over(spoke, divisor(spoke))
    up = across(_sum_of(n, m), t)
    if norm(up) <= NO_MEAN:
        up = across(_sum_of(at_a, at_b), t)
        if norm(up) <= NO_MEAN:
            up = 0.0, 0.0, 0.0
    up = over(up, divisor(up))
    return t, up, cross(up, t), h


@inlined
def _soft(v):
    """Return 3 tanh(x / 3) of each coordinate."""
    return (
        REACH * math.tanh(v[0] / REACH),
        REACH * math.tanh(v[1] / REACH),
        REACH * math.tanh(v[2] / REACH),
    )


@inlined
def _write(features, to, column, x, y, z):
    features[to, column], features[to, column + 1], features[to, column + 2] = x, y, z


@inlined
def _write_turned(features, to, column, v, s):
    _write(features, to, column, s * v[0], v[1], s * v[2])


@inlined
def _opposite(points, mesh, h):
    """Return the mean of a face's corners off a half-edge."""
    if len(mesh.face_of_corner) == 0:
        return row(points, opposite(mesh.corners, h))
    f = mesh.face_of_corner[h]
    first, stop = mesh.offsets[f], mesh.offsets[f + 1]
    after = h + 1 if h + 1 < stop else first
    x, y, z = 0.0, 0.0, 0.0
    for i in range(first, stop):
        if i != h and i != after:
            v = mesh.corners[i]
            x += points[v, 0]
            y += points[v, 1]
            z += points[v, 2]
    count = stop - first - 2
    return x / count, y / count, z / count


@kernel
def directed_features(
    begin: int,
    end: int,
    points: f8_2d,
    normals: f8_2d,
    fields: f8_2d,
    means: f8_2d,
    logs: f8_1d,
    sizes: f8_2d,
    mesh: Connectivity,
    features: f4_2d | f8_2d,
):
    """Write `directed-28` of both ways of edges begin … end − 1.

    Args:
        fields, means: of the rings, ``kernels.measures``.
        logs: (E,) logarithms of the edges' lengths.
        sizes: (V, 3) of ``measure_sizes``.
        features: (2 (end − begin), 28) out.
    """
    for e in range(max(begin, 0), end):
        a, b = mesh.edges[e, 0], mesh.edges[e, 1]
        left, right = _sides_of(mesh, e)
        n, m = _normal_of(normals, mesh, left), _normal_of(normals, mesh, right)
        p, q, at_a, at_b = row(points, a), row(points, b), row(fields, a), row(fields, b)
        t, up, side, h = _directed_frame(p, q, n, m, at_a, at_b)
        size = h if h > 0 else 1.0
        middle = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2
        c, d = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if left >= 0:
            c = _local(difference(_opposite(points, mesh, left), middle), t, up, side, size)
        if right >= 0:
            d = _local(difference(_opposite(points, mesh, right), middle), t, up, side, size)
        turn = 0.0
        if left >= 0 and right >= 0 and dot(n, n) > 0 and dot(m, m) > 0:
            turn = 2 * math.atan2(norm(difference(n, m)), norm(_sum_of(n, m)))
            if c[1] + d[1] > 0:
                turn = -turn
        sharp = 1.0 if mesh.edge_class[e] != INTERIOR else 0.0
        saturated = math.tanh(turn / TURNS[0]), math.tanh(turn / TURNS[1])
        c, d = _soft(c), _soft(d)
        m1, m2 = _local(at_a, t, up, side, 1.0), _local(at_b, t, up, side, 1.0)
        u1 = _soft(_local(row(means, a), t, up, side, size))
        u2 = _soft(_local(row(means, b), t, up, side, size))
        r1, r2 = _length_ratio(h, logs[e], sizes, a), _length_ratio(h, logs[e], sizes, b)
        for way in range(2):
            to = 2 * (e - begin) + way
            # The other way round T and B change their signs.
            s = 1.0 - 2.0 * way
            v, w = (a, b) if way == 0 else (b, a)
            _write(features, to, 0, turn, saturated[0], saturated[1])
            _write_turned(features, to, 3, c if way == 0 else d, s)
            _write_turned(features, to, 6, d if way == 0 else c, s)
            _write_turned(features, to, 9, m1 if way == 0 else m2, s)
            _write_turned(features, to, 12, m2 if way == 0 else m1, s)
            _write_turned(features, to, 15, u1 if way == 0 else u2, s)
            _write_turned(features, to, 18, u2 if way == 0 else u1, s)
            _write(features, to, 21, r1 if way == 0 else r2, r2 if way == 0 else r1, sizes[v, 1])
            _write(features, to, 24, sizes[w, 1], sizes[v, 2], sizes[w, 2])
            features[to, 27] = sharp


@inlined
def _local(v, t, up, side, size):
    """Return the coordinates of v / size in a frame."""
    return dot(v, t) / size, dot(v, up) / size, dot(v, side) / size


@inlined
def _length_ratio(h, log, sizes, v):
    return REACH * math.tanh((log - sizes[v, 0]) / REACH) if h > 0 and sizes[v, 0] > NO_LOG else 0.0


@kernel
def measure_sizes(
    begin: int, end: int, means: f8_2d, valence: i4_1d, on_boundary: b1_1d, sizes: f8_2d
):
    """Write logarithms of mean length and of valence / 6, and 1 at boundaries, of some vertices.

    The first is NO_LOG where there is no length.
    """
    for v in range(max(begin, 0), end):
        mean = means[v, LENGTH]
        sizes[v, 0] = math.log(mean) if mean > 0 else NO_LOG
        sizes[v, 1] = math.log(max(valence[v], 1) / 6.0)
        sizes[v, 2] = 1.0 if on_boundary[v] else 0.0


@kernel
def pool(
    begin: int,
    end: int,
    states: f4_2d | f8_2d,
    starts: i8_1d,
    spokes: u4_1d,
    total: f8_1d,
    pooled: f4_2d | f8_2d,
):
    """Write mean and largest state of the directed edges that leave vertices begin … end − 1.

    Args:
        states: (2 E, W).
        starts, spokes: where the directed edges that leave each vertex begin, and these.
        total: (W,) for sums.
        pooled: (end − begin, 2 W) out; 0 at vertices without edges.
    """
    width = states.shape[1]
    for v in range(max(begin, 0), end):
        i, first, stop = v - begin, starts[v], starts[v + 1]
        for k in range(width):
            total[k], pooled[i, width + k] = 0.0, -math.inf if stop > first else 0.0
        for spoke in range(first, stop):
            s = spokes[spoke]
            for k in range(width):
                total[k] += states[s, k]
                pooled[i, width + k] = max(pooled[i, width + k], states[s, k])
        for k in range(width):
            pooled[i, k] = total[k] / max(stop - first, 1)


@kernel
def gather(
    begin: int,
    end: int,
    states: f4_2d | f8_2d,
    told: f4_2d | f8_2d,
    edges: u4_2d,
    messages: f4_2d | f8_2d,
):
    """Write what edges begin … end − 1 hear, both ways.

    A row of ``messages``, (2 (end − begin), 2 W + H), is the edge's own state, that of the reverse
    edge, and the sum of what both vertices tell: ``told``, (V, 2 H), holds what each tells the
    edges that leave it, and those that reach it.
    """
    width, hidden = states.shape[1], told.shape[1] // 2
    for e in range(max(begin, 0), end):
        a, b = edges[e, 0], edges[e, 1]
        i = 2 * (e - begin)
        j = i + 1
        for k in range(width):
            there, back = states[2 * e, k], states[2 * e + 1, k]
            messages[i, k], messages[i, width + k] = there, back
            messages[j, k], messages[j, width + k] = back, there
        for k in range(hidden):
            messages[i, 2 * width + k] = told[a, k] + told[b, hidden + k]
            messages[j, 2 * width + k] = told[b, k] + told[a, hidden + k]


@kernel
def read_heads(
    begin: int,
    end: int,
    points: f8_2d,
    normals: f8_2d,
    fields: f8_2d,
    mesh: Connectivity,
    heads: f8_2d,
    asked: f8_2d,
    leaving: f8_2d,
    logits: f8_1d,
):
    """Write what edges begin … end − 1 answer, out of their frames.

    Args:
        heads: (2 (end − begin), A), of both ways.
        asked: (E, 3) out: the mean of F z over both directions.
        leaving: (2 E, 3) out: F y.
        logits: (E,) out: the mean of both logits of sharpness.
    """
    for e in range(max(begin, 0), end):
        i = 2 * (e - begin)
        j = i + 1
        a, b = mesh.edges[e, 0], mesh.edges[e, 1]
        left, right = _sides_of(mesh, e)
        n, m = _normal_of(normals, mesh, left), _normal_of(normals, mesh, right)
        t, up, side, _ = _directed_frame(
            row(points, a), row(points, b), n, m, row(fields, a), row(fields, b)
        )
        for k in range(3):
            z = (heads[i, EDGE] - heads[j, EDGE]) * t[k]
            z += (heads[i, EDGE + 1] + heads[j, EDGE + 1]) * up[k]
            z += (heads[i, EDGE + 2] - heads[j, EDGE + 2]) * side[k]
            asked[e, k] = z / 2
            y = heads[i, VERTEX] * t[k] + heads[i, VERTEX + 1] * up[k]
            leaving[2 * e, k] = y + heads[i, VERTEX + 2] * side[k]
            y = heads[j, VERTEX + 1] * up[k] - heads[j, VERTEX] * t[k]
            leaving[2 * e + 1, k] = y - heads[j, VERTEX + 2] * side[k]
        logits[e] = (heads[i, SHARPNESS] + heads[j, SHARPNESS]) / 2


@kernel
def mean_leaving(
    begin: int,
    end: int,
    leaving: f8_2d,
    corner_logits: f8_1d,
    starts: i8_1d,
    spokes: u4_1d,
    asked: f8_2d,
    logits: f8_1d,
):
    """Write means over the directed edges that leave vertices begin … end − 1.

    Args:
        leaving: (2 E, 3); corner_logits: (2 E,).
        asked: (V, 3) out; logits: (V,) out, 0 at vertices without edges.
    """
    for v in range(max(begin, 0), end):
        first, stop = starts[v], starts[v + 1]
        x, y, z, logit = 0.0, 0.0, 0.0, 0.0
        for i in range(first, stop):
            s = spokes[i]
            x += leaving[s, 0]
            y += leaving[s, 1]
            z += leaving[s, 2]
            logit += corner_logits[s]
        count = max(stop - first, 1)
        asked[v, 0], asked[v, 1], asked[v, 2] = x / count, y / count, z / count
        logits[v] = logit / count


@kernel
def mean_in_faces(begin: int, end: int, heights: f8_1d, mesh: Connectivity, asked: f8_1d):
    """Write the mean of ``heights`` (2 E,) over the edges around faces begin … end − 1.

    Both directions count: a mirror puts the face to the left of the other one.
    """
    for f in range(max(begin, 0), end):
        first, stop, total = mesh.offsets[f], mesh.offsets[f + 1], 0.0
        for h in range(first, stop):
            e = mesh.corner_edges[h]
            total += heights[2 * e] + heights[2 * e + 1]
        asked[f] = total / (2 * (stop - first))


@kernel
def find_leaving(edges: u4_2d, stops: i8_1d, spokes: u4_1d):
    """Write the directed edges that leave vertex 0, 1, …, one after another.

    Args:
        stops: (V,) where those of each vertex begin; on return, where they end.
        spokes: (2 E,) out.
    """
    for e in range(edges.shape[0]):
        for side in range(2):
            v = edges[e, side]
            spokes[stops[v]] = 2 * e + side
            stops[v] += 1


@kernel
def spread_gates(
    mesh: Connectivity,
    of_edges: f8_1d,
    opened: f8_1d,
    at_vertices: f8_1d,
    most: f8_1d,
    least: f8_1d,
):
    """Write how open faces are: the largest of their edges; and of these the largest and least.

    Args:
        of_edges: (E,) in [0, 1].
        opened: (F,) out.
        at_vertices: (V,) the largest around each; in: 0.
        most, least: (E,) of the faces beside each edge; in: 0 and 1.
    """
    for f in range(mesh.offsets.shape[0] - 1):
        first, stop, gate = mesh.offsets[f], mesh.offsets[f + 1], 0.0
        for h in range(first, stop):
            gate = max(gate, of_edges[mesh.corner_edges[h]])
        opened[f] = gate
        for h in range(first, stop):
            e, v = mesh.corner_edges[h], mesh.corners[h]
            most[e], least[e] = max(most[e], gate), min(least[e], gate)
            at_vertices[v] = max(at_vertices[v], gate)
