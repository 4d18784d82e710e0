"""Edges that stand alone, with the answers of geometry/crease_lines/edge_rows.py."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import (
    CLASSES,
    FLAGS_OUT,
    INDEX,
    INDICES,
    POINTS,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.edges import INTERIOR
from pns_common.fused.kernels.turns import clearly_half, rises, turn_cosine
from pns_common.fused.kernels.vectors import between, cross, dot
from pns_common.geometry.crease_lines.edge_rows import (
    TIMES_ITS_OWN,
    TIMES_THEIRS,
    UNEVEN,
    UNEVEN_END,
)

# What an edge beside another is to it.
NEITHER, LIKE, SHARPER = 0, 1, 2
BOTH = 3


def _beside(points, normals, faces, edges, half_edges, edge_class, parallel, e, turn, other):
    """Return what another edge is to an edge whose turn has this cosine."""
    if other == e or edge_class[other] != INTERIOR:
        return NEITHER
    bend, its_bend = 1 - turn, 1 - turn_cosine(normals, half_edges, edge_class, other)
    sharper = its_bend > TIMES_ITS_OWN * bend
    if not (sharper or bend <= TIMES_THEIRS * its_bend):
        return NEITHER
    own = between(points, edges[e, 0], edges[e, 1])
    its = between(points, edges[other, 0], edges[other, 1])
    along = dot(its, own)
    if not along * along >= parallel * (dot(its, its) * dot(own, own)):
        return NEITHER
    a, b, c, d = edges[e, 0], edges[e, 1], edges[other, 0], edges[other, 1]
    if ((a == c or b == d) and along < 0) or ((a == d or b == c) and along > 0):
        return NEITHER  # it goes on from this one's end
    if sharper:
        return SHARPER
    around = points, normals, faces, edges, half_edges
    return LIKE if rises(*around, e) == rises(*around, other) else NEITHER


def _area_square(points, faces, f):
    """Return four times the square of a face's area."""
    area = cross(
        between(points, faces[f, 0], faces[f, 1]), between(points, faces[f, 0], faces[f, 2])
    )
    return dot(area, area)


def _as_wide(first, second, times):
    """Return whether neither of two faces is so many times as wide, of the squares of areas."""
    most = times * times
    return first <= most * second and second <= most * first


@kernel(
    SIZE,
    *(POINTS, POINTS, INDICES, INDICES, INDICES, INDICES, CLASSES, REAL, REAL),
    *(INDEX, SIZE, SIZE, FLAGS_OUT),
)
def mark_alone(
    points,
    normals,
    faces,
    edges,
    face_edges,
    half_edges,
    edge_class,
    parallel,
    row_cosine,
    flat,
    begin,
    end,
    alone,
):
    """Mark those of the edges begin … end − 1 that turn far, or are in no row.

    On a side are the edges of its face, and of the faces across those of them that turn less than
    half as much. ``parallel`` is the square of the least cosine between edges.
    """
    shape = points, normals, faces, edges, half_edges, edge_class, parallel
    for i in range(natural(begin), end):
        e = flat[i]
        turn = turn_cosine(normals, half_edges, edge_class, e)
        like, sharper = 0, 0  # a bit for each side
        for h in range(2):
            f = half_edges[e, h] // 3
            for k in range(3):
                side = face_edges[f, k]
                found = _beside(*shape, e, turn, side)
                like |= (found == LIKE) << h
                sharper |= (found == SHARPER) << h
                if side == e or edge_class[side] != INTERIOR:
                    continue
                if not turn_cosine(normals, half_edges, edge_class, side) > clearly_half(turn):
                    continue
                first = half_edges[side, 0] // 3
                beyond = half_edges[side, 1] // 3 if first == f else first
                for m in range(3):
                    found = _beside(*shape, e, turn, face_edges[beyond, m])
                    like |= (found == LIKE) << h
                    sharper |= (found == SHARPER) << h
        first = _area_square(points, faces, half_edges[e, 0] // 3)
        second = _area_square(points, faces, half_edges[e, 1] // 3)
        in_row = like == BOTH and _as_wide(first, second, UNEVEN)
        meets = (like & 1 and sharper & 2) or (like & 2 and sharper & 1)
        ends = meets and _as_wide(first, second, UNEVEN_END)
        alone[i] = turn < row_cosine or not (in_row or ends)
    return 0
