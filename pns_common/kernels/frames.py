"""Edge frames F and edge features φ (section 3.2 of the paper)."""

from __future__ import annotations

from pns_common.kernels import inlined, kernel
from pns_common.kernels.connectivity import next_corner, previous_corner
from pns_common.kernels.measures import HEIGHT
from pns_common.kernels.vectors import across, between, cross, divisor, dot, over, row

# Faces are antiparallel where n1 · n2 ≤ −1 + ANTIPARALLEL (the paper's ε).
ANTIPARALLEL = 1e-6
# Feature columns: curvature; four logarithms of side ratios; then those with a sign.
LOGS, DIHEDRAL, ENDS, WINGS, UMBRELLAS = 1, 5, 6, 10, 14


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
    points,
    normals,
    fields,
    lengths,
    logs,
    bends,
    corners,
    edges,
    corner_edges,
    half_edges,
    rows,
    begin,
    end,
    symmetric,
    frames,
    curvature,
    sides,
    length,
    degenerate,
    features,
):
    """Write frames and features of the interior edges rows[begin:end]; row 0 is the first of them.

    Args:
        fields: (V, 4) mean normals and umbrella heights; read by signed features alone.
        lengths, logs: (E,) lengths and their logarithms.
        bends: (F,) mean x over the edges of each face; (0,) where it is not wanted.
        symmetric: whether c lies to the left of a → b and degenerate edges have x = 0. Otherwise c
            lies in the face of lower index.
        frames: (N, 9) out: T, N, B.
        curvature: (N,) out: x.
        sides: (N,) out: the smaller bend of both faces, 0 where there is no frame.
        length: (N,) out: h.
        degenerate: (N,) out: whether the frame is the fallback.
        features: (N, K) out; K = 5, 14 or 18.
    """
    width = features.shape[1]
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
        n, m = row(normals, h1 // 3), row(normals, h2 // 3)
        t, up, side, x, fallback = edge_frame(n, m, between(points, a, b))
        if symmetric and fallback:
            x = 0.0
        for k in range(3):
            frames[to, k], frames[to, 3 + k], frames[to, 6 + k] = t[k], up[k], side[k]
        curvature[to], length[to], degenerate[to] = x, lengths[e], fallback
        if len(bends):
            sides[to] = 0.0 if fallback else min(bends[h1 // 3], bends[h2 // 3])
        features[to, 0] = x
        features[to, LOGS] = logs[ac] - logs[e]
        features[to, LOGS + 1] = logs[bc] - logs[e]
        features[to, LOGS + 2] = logs[ad] - logs[e]
        features[to, LOGS + 3] = logs[bd] - logs[e]
        if width > DIHEDRAL:
            features[to, DIHEDRAL] = dot(cross(n, m), t)
            at_a, at_b, at_c, at_d = row(fields, a), row(fields, b), row(fields, c), row(fields, d)
            features[to, ENDS], features[to, ENDS + 1] = dot(at_a, t), dot(at_b, t)
            features[to, ENDS + 2], features[to, ENDS + 3] = dot(at_a, side), dot(at_b, side)
            features[to, WINGS], features[to, WINGS + 1] = dot(at_c, t), dot(at_d, t)
            features[to, WINGS + 2], features[to, WINGS + 3] = dot(at_c, side), dot(at_d, side)
        if width > UMBRELLAS:
            features[to, UMBRELLAS], features[to, UMBRELLAS + 1] = (
                fields[a, HEIGHT],
                fields[b, HEIGHT],
            )
            features[to, UMBRELLAS + 2] = fields[c, HEIGHT]
            features[to, UMBRELLAS + 3] = fields[d, HEIGHT]
