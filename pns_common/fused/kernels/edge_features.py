"""Frames and features of interior edges, with the bits of frames.py and edge_features.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    FLAGS_OUT,
    INDEX,
    INDEX_OUT,
    NUMBERS,
    NUMBERS_OUT,
    POINTS_OUT,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.rings import HEIGHT
from pns_common.fused.kernels.together import TOGETHER, keep, kept
from pns_common.fused.kernels.vectors import cross, difference, divisor, dot
from pns_common.geometry.frames import ANTIPARALLEL

# Feature columns: curvature, four log ratios, then those with a sign.
LOGS, DIHEDRAL, ENDS, WINGS, UMBRELLAS = 1, 5, 6, 10, 14
# What is held of TOGETHER edges, a row of numbers each: first normals of both faces, the spoke and
# h, then what is made of them in their place.
FIRST, SECOND, SPOKE, H = 0, 3, 6, 9
TANGENT, NORMAL, BINORMAL, X, SINE, FALLBACK, HELD = 0, 3, 6, 9, 10, 11, 12


def _after(half_edge):
    """Return the half-edge of the same face that leaves where it ends.

    Computed: a processor foretells badly which corner is a face's last.
    """
    return natural(half_edge + 1 - 3 * (half_edge % 3 == 2))


def _before(half_edge):
    """Return the half-edge of the same face that comes to where it starts."""
    return natural(half_edge - 1 + 3 * (half_edge % 3 == 0))


def _vector(values, at):
    return values[at], values[at + 1], values[at + 2]


def _turn(held, symmetric):
    """Put frames, x, sin of the dihedral angle and fallback in place of what they are made of.

    It does not branch, so that it runs on vectors: edge by edge its roots and quotients would take
    half of all time.
    """
    for lane in range(TOGETHER):
        n, m, spoke = kept(held, FIRST, lane), kept(held, SECOND, lane), kept(held, SPOKE, lane)
        cosine = dot(n, m)
        undefined = (held[H * TOGETHER + lane] == 0) | (dot(n, n) == 0) | (dot(m, m) == 0)
        fallback = undefined | (cosine <= -1 + ANTIPARALLEL)
        size = divisor(spoke)
        tangent = (
            1.0 if fallback else spoke[0] / size,
            0.0 if fallback else spoke[1] / size,
            0.0 if fallback else spoke[2] / size,
        )
        mean = (
            0.0 if fallback else n[0] + m[0],
            1.0 if fallback else n[1] + m[1],
            0.0 if fallback else n[2] + m[2],
        )
        along = dot(mean, tangent)
        upwards = (
            mean[0] - along * tangent[0],
            mean[1] - along * tangent[1],
            mean[2] - along * tangent[2],
        )
        size = divisor(upwards)
        normal = upwards[0] / size, upwards[1] / size, upwards[2] / size
        keep(held, TANGENT, lane, tangent)
        keep(held, NORMAL, lane, normal)
        keep(held, BINORMAL, lane, cross(tangent, normal))
        held[X * TOGETHER + lane] = 0.0 if undefined | (symmetric & fallback) else 1 - cosine
        held[SINE * TOGETHER + lane] = dot(cross(n, m), tangent)
        held[FALLBACK * TOGETHER + lane] = 1.0 if fallback else 0.0


@kernel(
    SIZE,
    *(NUMBERS, NUMBERS, NUMBERS, NUMBERS, NUMBERS, NUMBERS),
    *(INDEX, INDEX, INDEX, INDEX, INDEX, SIZE, SIZE, SIZE),
    *(INDEX_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT, NUMBERS_OUT, FLAGS_OUT),
    *(POINTS_OUT, NUMBERS_OUT, NUMBERS_OUT),
)
def look(
    points,
    normals,
    fields,
    bends,
    lengths,
    logs,
    starts,
    edges,
    sides,
    half_edges,
    interior,
    begin,
    end,
    symmetric,
    stencils,
    frame,
    length,
    longest,
    curvature,
    degenerate,
    features,
    gentlest,
    held,
):
    """Write frames and features of the interior edges begin … end − 1; row 0 is edge ``begin``'s.

    All but ``features`` comes row after row in one: how far apart rows are is then compiled in.

    Args:
        points, normals: (3 V,) and (3 F,).
        fields: (4 V,) mean normal and umbrella height; read where ``features`` has signed columns.
        bends: (F,) b of each face; empty where gates do not read it.
        lengths, logs: (E,) h of each edge, and its logarithm.
        starts, sides: (3 F,) where each half-edge starts, and its edge.
        edges, half_edges: (2 E,) the ends of each edge, and its half-edges.
        symmetric: 1 where c lies to the left of a → b and degenerate edges have x = 0, else 0.
        stencils: (4 N,) out: a, b, c, d.
        frame: (9 N,) out: T, N, B.
        length, longest: out: h and h̄, the longest edge of both faces.
        curvature, degenerate: out: x, and whether the frame is the fallback.
        features: (N, K) out.
        gentlest: out: the smaller b of both faces; empty where ``bends`` is.
        held: (HELD TOGETHER,) finite on entry, overwritten: of some edges, one beside the other.
    """
    wide = features.shape[1]
    for first in range(0, end - begin, TOGETHER):
        count = min(TOGETHER, end - begin - first)
        for lane in range(count):
            i = natural(first + lane)
            e = interior[natural(begin) + i]
            a, b = edges[2 * e], edges[2 * e + 1]
            h1, h2 = half_edges[2 * e], half_edges[2 * e + 1]
            forwards = starts[h1] == a
            if symmetric and not forwards:
                h1, h2, forwards = h2, h1, True
            f, g, before_h1, before_h2 = h1 // 3, h2 // 3, _before(h1), _before(h2)
            stencils[4 * i], stencils[4 * i + 1] = a, b
            stencils[4 * i + 2], stencils[4 * i + 3] = starts[before_h1], starts[before_h2]
            p, q = _vector(points, 3 * a), _vector(points, 3 * b)
            keep(held, FIRST, lane, _vector(normals, 3 * f))
            keep(held, SECOND, lane, _vector(normals, 3 * g))
            keep(held, SPOKE, lane, difference(q, p))
            h = lengths[e]
            held[H * TOGETHER + lane] = length[i] = h
            if len(bends):
                gentlest[i] = min(bends[f], bends[g])
            # The two half-edges run against each other.
            ac, bc = sides[before_h1], sides[_after(h1)]
            ad, bd = sides[_after(h2)], sides[before_h2]
            if not forwards:
                ac, bc, ad, bd = bc, ac, bd, ad
            longest[i] = max(max(max(max(h, lengths[ac]), lengths[bc]), lengths[ad]), lengths[bd])
            features[i, LOGS] = logs[ac] - logs[e]
            features[i, LOGS + 1] = logs[bc] - logs[e]
            features[i, LOGS + 2] = logs[ad] - logs[e]
            features[i, LOGS + 3] = logs[bd] - logs[e]
        _turn(held, symmetric != 0)
        for lane in range(count):
            i = natural(first + lane)
            tangent, normal = kept(held, TANGENT, lane), kept(held, NORMAL, lane)
            binormal, x = kept(held, BINORMAL, lane), held[X * TOGETHER + lane]
            for k in range(3):
                frame[9 * i + k], frame[9 * i + 3 + k] = tangent[k], normal[k]
                frame[9 * i + 6 + k] = binormal[k]
            features[i, 0] = curvature[i] = x
            degenerate[i] = held[FALLBACK * TOGETHER + lane] > 0
            a, b = natural(4 * stencils[4 * i]), natural(4 * stencils[4 * i + 1])
            c, d = natural(4 * stencils[4 * i + 2]), natural(4 * stencils[4 * i + 3])
            if wide > DIHEDRAL:
                at_a, at_b = _vector(fields, a), _vector(fields, b)
                at_c, at_d = _vector(fields, c), _vector(fields, d)
                features[i, DIHEDRAL] = held[SINE * TOGETHER + lane]
                features[i, ENDS] = dot(at_a, tangent)
                features[i, ENDS + 1] = dot(at_b, tangent)
                features[i, ENDS + 2] = dot(at_a, binormal)
                features[i, ENDS + 3] = dot(at_b, binormal)
                features[i, WINGS] = dot(at_c, tangent)
                features[i, WINGS + 1] = dot(at_d, tangent)
                features[i, WINGS + 2] = dot(at_c, binormal)
                features[i, WINGS + 3] = dot(at_d, binormal)
            if wide > UMBRELLAS:
                features[i, UMBRELLAS] = fields[a + HEIGHT]
                features[i, UMBRELLAS + 1] = fields[b + HEIGHT]
                features[i, UMBRELLAS + 2] = fields[c + HEIGHT]
                features[i, UMBRELLAS + 3] = fields[d + HEIGHT]
    return 0
