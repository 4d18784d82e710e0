"""Sums around vertices, with the bits of geometry/rings.py and ring_sums.py.

A sum runs over its faces or edges in ascending order: each thread owns the vertices begin … end − 1
and reads all faces or edges.
"""

from __future__ import annotations

import math

from pns_common.formula.prior import CLEAR_NORMAL
from pns_common.fused.kernels.compiled import (
    INDEX,
    INDEX_OUT,
    INDICES,
    NUMBERS,
    NUMBERS_OUT,
    POINTS,
    POINTS_OUT,
    REAL,
    SIZE,
    kernel,
    natural,
)
from pns_common.fused.kernels.normals import normal_and_area
from pns_common.fused.kernels.owned import owned_rows
from pns_common.fused.kernels.vectors import between, dot, norm, row

# Columns of a vertex's sums, which become means.
UMBRELLA, RING_SQUARE, MEAN_JUMP, MEAN_BEND, BEND_SQUARE, LENGTH, PULL = 0, 3, 4, 5, 6, 7, 8
MEAN_NETWORK_SQUARE = 11
OPENING, NEAR_HEIGHT, NEAR_JUMP = 12, 13, 14
VERTEX_COLUMNS = 15
# Of a face: twice its area vector, and the length of that.
AREA = 3
# Of a vertex: mean normal and umbrella height.
HEIGHT = 3


def clear_normal(mean):
    """Return m̂ of a mean normal, as in ``prior.clear_normals``."""
    agreement = norm(mean)
    clear = agreement if agreement > CLEAR_NORMAL else CLEAR_NORMAL
    return mean[0] / clear, mean[1] / clear, mean[2] / clear


@kernel(SIZE, POINTS, INDICES, SIZE, SIZE, POINTS_OUT, POINTS_OUT, by_rows=True)
def measure_faces(points, faces, begin, end, normals, areas):
    """Write normals (F, 3), area vectors and their lengths (F, 4) of faces begin … end − 1.

    ``areas`` is (0, 4) where nobody asks for them.
    """
    for f in range(natural(begin), end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        corners = row(points, a), row(points, b), row(points, c)
        normal, vector, length = normal_and_area(*corners)
        for k in range(3):
            normals[f, k] = normal[k]
        if len(areas):
            for k in range(3):
                areas[f, k] = vector[k]
            areas[f, AREA] = length
    return 0


@kernel(SIZE, INDICES, INDICES, POINTS, SIZE, SIZE, POINTS_OUT, by_rows=True)
def mean_normals(faces, reach, areas, begin, end, fields):
    """Write m_v into the first three columns of ``fields`` (V, 4)."""
    for v in range(natural(begin), end):
        for k in range(4):
            fields[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, asked = owned_rows(faces, reach, block, begin, end)
        for i in range(asked):
            f = first + i
            for k in range(3):
                v = faces[f, k]
                if begin <= v < end:
                    for column in range(4):
                        fields[v, column] += areas[f, column]
    for v in range(natural(begin), end):
        area = fields[v, AREA]
        for k in range(3):
            fields[v, k] = fields[v, k] / area if area > 0 else 0.0
        fields[v, HEIGHT] = 0.0
    return 0


@kernel(SIZE, INDICES, NUMBERS, REAL, REAL, SIZE, SIZE, NUMBERS_OUT, by_rows=True)
def face_bends(face_edges, jumps, gentle, sharp, begin, end, bends):
    """Write b of faces begin … end − 1 (``side_gate.face_bends``).

    x counts between gentle and sharp.
    """
    for f in range(natural(begin), end):
        total = 0.0
        for i in range(3):
            x = jumps[face_edges[f, i]]
            total += x * min(max((sharp - x) / (sharp - gentle), 0.0), 1.0)
        bends[f] = total / 3
    return 0


def _add_spoke(sums, v, spoke, square, jump, bend, length, network_square):
    sums[v, UMBRELLA] += spoke[0]
    sums[v, UMBRELLA + 1] += spoke[1]
    sums[v, UMBRELLA + 2] += spoke[2]
    sums[v, RING_SQUARE] += square
    sums[v, MEAN_JUMP] += jump
    sums[v, MEAN_BEND] += bend
    sums[v, BEND_SQUARE] += bend * bend
    sums[v, LENGTH] += length
    sums[v, PULL] += jump / 2 * spoke[0]
    sums[v, PULL + 1] += jump / 2 * spoke[1]
    sums[v, PULL + 2] += jump / 2 * spoke[2]
    sums[v, MEAN_NETWORK_SQUARE] += network_square


@kernel(
    SIZE,
    *(POINTS, INDICES, INDICES, NUMBERS, NUMBERS, NUMBERS, SIZE, SIZE),
    *(POINTS_OUT, INDEX_OUT),
    by_rows=True,
)
def mean_spokes(points, edges, reach, bends, jumps, network_lengths, begin, end, means, valence):
    """Write means over the spokes of vertices begin … end − 1, and 0 to the rest of ``means``."""
    for v in range(natural(begin), end):
        valence[v] = 0
        for k in range(VERTEX_COLUMNS):
            means[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, asked = owned_rows(edges, reach, block, begin, end)
        for i in range(asked):
            e = first + i
            a, b = edges[e, 0], edges[e, 1]
            mine, theirs = begin <= a < end, begin <= b < end
            if mine or theirs:
                # All is read before anything is written.
                spoke = between(points, a, b)
                square, bend, jump, ell = dot(spoke, spoke), bends[e], jumps[e], network_lengths[e]
                length = math.sqrt(square if square > 0 else 1e-300)
                network_square = ell * ell if ell < length else square
                if mine:
                    valence[a] += 1
                    _add_spoke(means, a, spoke, square, jump, bend, length, network_square)
                if theirs:
                    valence[b] += 1
                    back = -spoke[0], -spoke[1], -spoke[2]
                    _add_spoke(means, b, back, square, jump, bend, length, network_square)
    for v in range(natural(begin), end):
        count = float(max(valence[v], 1))
        for k in range(OPENING):
            means[v, k] = means[v, k] / count
    return 0


@kernel(SIZE, POINTS, INDEX, SIZE, SIZE, POINTS_OUT)
def umbrella_heights(means, sharp, begin, end, fields):
    """Write u_v · m_v / h_v into ``fields``; 0 where a sharp edge ends.

    ``sharp`` counts the sharp edges at each vertex; (0,) where there are none at all.
    """
    for v in range(natural(begin), end):
        fields[v, HEIGHT] = 0.0
        if len(sharp) and sharp[v]:
            continue
        square = means[v, RING_SQUARE]
        reach = math.sqrt(square) if square > 0 else 0.0
        if reach > 0:
            fields[v, HEIGHT] = dot(row(means, v), row(fields, v)) / reach
    return 0


@kernel(SIZE, POINTS, POINTS, INDEX, INDEX, NUMBERS, SIZE, SIZE, POINTS_OUT)
def prior_pushes(means, fields, valence, ringed, ring_weight, begin, end, pushes):
    """Write d_v of the prior at s = 1 (``prior.normal_pushes``).

    Args:
        ringed: 1 where the vertex may move, else 0.
        ring_weight: w_k for each valence that occurs.
    """
    for v in range(natural(begin), end):
        normal = clear_normal(row(fields, v))
        weight = ring_weight[valence[v]] * ringed[v]
        inwards = weight * dot(row(means, v), normal)
        for k in range(3):
            pushes[v, k] = -inwards * normal[k]
    return 0


def _add_neighbour(sums, v, opening, height, jump):
    sums[v, OPENING] += opening
    sums[v, NEAR_HEIGHT] += height
    sums[v, NEAR_JUMP] += jump


@kernel(SIZE, POINTS, INDICES, INDICES, POINTS, INDEX, SIZE, SIZE, POINTS_OUT, by_rows=True)
def mean_neighbours(points, edges, reach, fields, valence, begin, end, means):
    """Write means of what lies at the far ends of spokes: opening, umbrella heights, mean jump.

    Reads MEAN_JUMP of all vertices, and writes the last three columns of its own.
    """
    for block in range(reach.shape[0]):
        first, asked = owned_rows(edges, reach, block, begin, end)
        for i in range(asked):
            e = first + i
            a, b = edges[e, 0], edges[e, 1]
            mine, theirs = begin <= a < end, begin <= b < end
            if mine or theirs:
                # All is read before anything is written.
                opening = dot(between(fields, a, b), between(points, a, b))
                here, there = fields[a, HEIGHT], fields[b, HEIGHT]
                jump_here, jump_there = means[a, MEAN_JUMP], means[b, MEAN_JUMP]
                if mine:
                    _add_neighbour(means, a, opening, there, jump_there)
                if theirs:
                    _add_neighbour(means, b, opening, here, jump_here)
    for v in range(natural(begin), end):
        count = float(max(valence[v], 1))
        for k in range(OPENING, VERTEX_COLUMNS):
            means[v, k] = means[v, k] / count
    return 0
