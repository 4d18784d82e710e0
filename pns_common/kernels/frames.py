"""Edge frames F and edge features φ (section 3.2 of the paper)."""

from __future__ import annotations

from pns_common.kernels import (
    b1_1d,
    f4_2d,
    f8_1d,
    f8_2d,
    i4_2d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
    u4_2d,
)
from pns_common.kernels.connectivity import next_corner, previous_corner, triangle_of
from pns_common.kernels.measures import HEIGHT
from pns_common.kernels.vectors import (
    across,
    between,
    cross,
    divisor,
    dot,
    over,
    row,
)

# Faces are antiparallel where n1 · n2 ≤ −1 + ANTIPARALLEL (the paper's ε).
ANTIPARALLEL = 1e-6
# Lengths of zero are read as this, so that every logarithm is finite.
SHORTEST = 1e-150
# Groups of features, by their place in `features.EDGE_GROUPS`.
CURVATURE, SHAPE, DIHEDRAL, ENDS, WINGS, UMBRELLA = range(6)


@inlined
def edge_frame(n, m, spoke):
    """Return T, N, B, x and whether the frame is the fallback of world axes (equations 6 to 8).

    The fallback serves edges without length, faces without area, and antiparallel faces.
    """
    cosine = dot(n, m)
    undefined = dot(spoke, spoke) == 0 or dot(n, n) == 0 or dot(m, m) == 0
    fallback = undefined or cosine <= -1 + ANTIPARALLEL
    if fallback:
        tangent, mean = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    else:
        tangent = over(spoke, divisor(spoke))
        mean = n[0] + m[0], n[1] + m[1], n[2] + m[2]
    upwards = across(mean, tangent)
    normal = over(upwards, divisor(upwards))
    return tangent, normal, cross(tangent, normal), 0.0 if undefined else 1 - cosine, fallback


@kernel
def frames_and_features(
    points: f8_2d,
    normals: f8_2d,
    fields: f8_2d,
    lengths: f8_1d,
    logs: f8_1d,
    corners: u4_1d,
    edges: u4_2d,
    corner_edges: u4_1d,
    half_edges: i4_2d,
    rows: u4_1d,
    begin: int,
    end: int,
    symmetric: bool,
    starts: i8_1d,
    frames: f8_2d,
    curvature: f8_1d,
    length: f8_1d,
    degenerate: b1_1d,
    features: f4_2d | f8_2d,
):
    """Write frames and features of the interior edges rows[begin:end]; row 0 is the first of them.

    Args:
        fields: (V, 4) mean normals and umbrella heights; (0, 4) where no group reads rings.
        lengths, logs: (E,) lengths and their logarithms.
        symmetric: whether c lies to the left of a → b and degenerate edges have x = 0. Otherwise c
            lies in the face of lower index.
        starts: the first column of each group of features, −1 for none.
        frames: (N, 9) out: T, N, B.
        curvature: (N,) out: x.
        length: (N,) out: h.
        degenerate: (N,) out: whether the frame is the fallback.
        features: (N, K) out.
    """
    for i in range(begin, end):
        e, to = rows[i], i - begin
        a, b = edges[e, 0], edges[e, 1]
        h1, h2 = half_edges[e, 0], half_edges[e, 1]
        forwards = corners[h1] == a
        if symmetric and not forwards:
            h1, h2, forwards = h2, h1, True
        before1, before2 = previous_corner(h1), previous_corner(h2)
        c, d = corners[before1], corners[before2]
        # The two half-edges run against each other.
        ac, bc = corner_edges[before1], corner_edges[next_corner(h1)]
        ad, bd = corner_edges[next_corner(h2)], corner_edges[before2]
        if not forwards:
            ac, bc, ad, bd = bc, ac, bd, ad
        n, m = row(normals, triangle_of(h1)), row(normals, triangle_of(h2))
        t, up, side, x, fallback = edge_frame(n, m, between(points, a, b))
        if symmetric and fallback:
            x = 0.0
        for k in range(3):
            frames[to, k], frames[to, 3 + k], frames[to, 6 + k] = t[k], up[k], side[k]
        curvature[to], length[to], degenerate[to] = x, lengths[e], fallback
        at = logs[ac], logs[bc], logs[ad], logs[bd]
        _write_two_faces(features, to, starts, x, at, logs[e], dot(cross(n, m), t))
        if len(fields):
            at_a, at_b = four(fields, a), four(fields, b)
            at_c, at_d = four(fields, c), four(fields, d)
            _write_rings(features, to, starts, t, side, at_a, at_b, at_c, at_d)


@inlined
def four(values, i):
    """Return the first four columns of a row."""
    return values[i, 0], values[i, 1], values[i, 2], values[i, 3]


@inlined
def _write_two_faces(features, to, starts, x, logs, log, dihedral):
    """Write the groups that see both faces alone; ``logs`` and ``log`` are of ac … bd and of h."""
    k = starts[CURVATURE]
    if k >= 0:
        features[to, k] = x
    k = starts[SHAPE]
    if k >= 0:
        features[to, k], features[to, k + 1] = logs[0] - log, logs[1] - log
        features[to, k + 2], features[to, k + 3] = logs[2] - log, logs[3] - log
    k = starts[DIHEDRAL]
    if k >= 0:
        features[to, k] = dihedral


@inlined
def _write_rings(features, to, starts, t, side, at_a, at_b, at_c, at_d):
    """Write the groups that see rings: ``at_a`` … ``at_d``, mean normals and umbrella heights."""
    k = starts[ENDS]
    if k >= 0:
        features[to, k], features[to, k + 1] = dot(at_a, t), dot(at_b, t)
        features[to, k + 2], features[to, k + 3] = dot(at_a, side), dot(at_b, side)
    k = starts[WINGS]
    if k >= 0:
        features[to, k], features[to, k + 1] = dot(at_c, t), dot(at_d, t)
        features[to, k + 2], features[to, k + 3] = dot(at_c, side), dot(at_d, side)
    k = starts[UMBRELLA]
    if k >= 0:
        features[to, k], features[to, k + 1] = at_a[HEIGHT], at_b[HEIGHT]
        features[to, k + 2], features[to, k + 3] = at_c[HEIGHT], at_d[HEIGHT]


@inlined
def wing(values, h, corners, offsets, face_of_corner):
    """Return the mean of the first four columns over a face's corners other than an edge's ends.

    The edge leaves corner h. Of three columns the last one returned is 0.
    """
    f = face_of_corner[h]
    first, stop = offsets[f], offsets[f + 1]
    after, width = h + 1 if h + 1 < stop else first, values.shape[1]
    x, y, z, w = 0.0, 0.0, 0.0, 0.0
    for i in range(first, stop):
        if i != h and i != after:
            v = corners[i]
            x += values[v, 0]
            y += values[v, 1]
            z += values[v, 2]
            w += values[v, 3] if width > HEIGHT else 0.0
    count = stop - first - 2
    return x / count, y / count, z / count, w / count
