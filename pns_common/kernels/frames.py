"""Edge frames F and edge features φ (section 3.2 of the paper)."""

from __future__ import annotations

from pns_common.kernels import (
    Connectivity,
    b1_1d,
    f4_2d,
    f8_1d,
    f8_2d,
    i8_1d,
    inlined,
    kernel,
    u4_1d,
)
from pns_common.kernels.connectivity import next_corner, previous_corner, triangle_of
from pns_common.kernels.measures import HEIGHT
from pns_common.kernels.vectors import across, between, cross, divisor, dot, over, row

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
    mesh: Connectivity,
    rows: u4_1d,
    symmetric: bool,
    starts: i8_1d,
    frames: f8_2d,
    curvature: f8_1d,
    length: f8_1d,
    degenerate: b1_1d,
    features: f4_2d | f8_2d,
):
    """Write frames and features of N interior edges of triangles.

    Args:
        rows: (N,) their numbers.
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
    corners, corner_edges = mesh.corners, mesh.corner_edges
    for i in range(rows.shape[0]):
        e = rows[i]
        a, b = mesh.edges[e, 0], mesh.edges[e, 1]
        h1, h2 = mesh.half_edges[e, 0], mesh.half_edges[e, 1]
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
            frames[i, k], frames[i, 3 + k], frames[i, 6 + k] = t[k], up[k], side[k]
        curvature[i], length[i], degenerate[i] = x, lengths[e], fallback
        at = logs[ac], logs[bc], logs[ad], logs[bd]
        _write_two_faces(features, i, starts, x, at, logs[e], dot(cross(n, m), t))
        if len(fields):
            _write_rings(features, i, starts, t, side, fields, a, b, c, d)


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
def _write_rings(features, to, starts, t, side, fields, a, b, c, d):
    """Write the groups that see rings: mean normals and umbrella heights."""
    for group, v, w in ((ENDS, a, b), (WINGS, c, d)):
        k = starts[group]
        if k >= 0:
            n, m = row(fields, v), row(fields, w)
            features[to, k], features[to, k + 1] = dot(n, t), dot(m, t)
            features[to, k + 2], features[to, k + 3] = dot(n, side), dot(m, side)
    k = starts[UMBRELLA]
    if k >= 0:
        features[to, k], features[to, k + 1] = fields[a, HEIGHT], fields[b, HEIGHT]
        features[to, k + 2], features[to, k + 3] = fields[c, HEIGHT], fields[d, HEIGHT]
