"""Measurements of faces, edges and the rings of vertices that the operator reads.

Sums around a vertex run over its faces or edges in ascending order: each thread owns a range of
vertices and reads all faces or edges.
"""

from __future__ import annotations

import math

from pns_common.kernels import Connectivity, f8_1d, f8_2d, i4_1d, i8_2d, inlined, kernel, u4_2d
from pns_common.kernels.connectivity import INTERIOR, SKIPPED_ROWS, face_of, rows_of_block
from pns_common.kernels.vectors import (
    NO_AREA,
    between,
    cross,
    difference,
    dot,
    norm,
    normal_and_area,
    over,
    root,
    row,
)

# Columns of a vertex's means over its spokes: umbrella vector, squared length, length.
UMBRELLA, SQUARE, LENGTH, MEANS = 0, 3, 4, 5
# Columns of a vertex's fields: mean normal, umbrella height.
HEIGHT, FIELDS = 3, 4
# Column of a face's area vector with its length.
AREA = 3
SHORTEST_SQUARE = 1e-300


@kernel
def measure_faces(begin: int, end: int, points: f8_2d, faces: u4_2d, normals: f8_2d, areas: f8_2d):
    """Write unit normals, and twice the area vectors with their lengths, of triangles.

    ``areas`` is (F, 4), or (0, 4) where it is not wanted.
    """
    for f in range(max(begin, 0), end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        normal, vector, length = normal_and_area(row(points, a), row(points, b), row(points, c))
        for k in range(3):
            normals[f, k] = normal[k]
        if len(areas):
            for k in range(3):
                areas[f, k] = vector[k]
            areas[f, AREA] = length


@kernel
def measure_quads(begin: int, end: int, points: f8_2d, faces: u4_2d, normals: f8_2d):
    """Write the unit normals of quads begin … end − 1: of their area vectors; 0 without area."""
    for f in range(max(begin, 0), end):
        u = difference(row(points, faces[f, 2]), row(points, faces[f, 0]))
        v = difference(row(points, faces[f, 3]), row(points, faces[f, 1]))
        vector, shortest = cross(u, v), NO_AREA * (dot(u, u) + dot(v, v))
        known = dot(vector, vector) > shortest * shortest
        normal = over(vector, norm(vector)) if known else (0.0, 0.0, 0.0)
        for k in range(3):
            normals[f, k] = normal[k]


@kernel
def measure_polygons(
    begin: int, end: int, points: f8_2d, mesh: Connectivity, normals: f8_2d, areas: f8_2d
):
    """Write what ``measure_faces`` does, of polygons: their area vectors are sums over fans."""
    for f in range(max(begin, 0), end):
        first, stop = mesh.offsets[f], mesh.offsets[f + 1]
        origin = row(points, mesh.corners[first])
        vector, squares = (0.0, 0.0, 0.0), 0.0
        before = difference(row(points, mesh.corners[first + 1]), origin)
        squares += dot(before, before)
        for h in range(first + 2, stop):
            spoke = difference(row(points, mesh.corners[h]), origin)
            part = cross(before, spoke)
            vector = vector[0] + part[0], vector[1] + part[1], vector[2] + part[2]
            squares += dot(spoke, spoke)
            before = spoke
        length, shortest = norm(vector), NO_AREA * squares
        known = dot(vector, vector) > shortest * shortest
        for k in range(3):
            normals[f, k] = vector[k] / length if known else 0.0
        if len(areas):
            for k in range(3):
                areas[f, k] = vector[k]
            areas[f, AREA] = length


@kernel
def measure_edges(
    begin: int,
    end: int,
    points: f8_2d,
    normals: f8_2d,
    mesh: Connectivity,
    lengths: f8_1d,
    jumps: f8_1d,
):
    """Write h and x = 1 − n1 · n2 of edges begin … end − 1; x is 0 where one is not interior."""
    for e in range(max(begin, 0), end):
        spoke = between(points, mesh.edges[e, 0], mesh.edges[e, 1])
        lengths[e], jumps[e] = root(dot(spoke, spoke)), 0.0
        if mesh.edge_class[e] != INTERIOR:
            continue
        n = row(normals, face_of(mesh, mesh.half_edges[e, 0]))
        m = row(normals, face_of(mesh, mesh.half_edges[e, 1]))
        if dot(n, n) > 0 and dot(m, m) > 0:
            chord = difference(n, m)
            jumps[e] = dot(chord, chord) / 2


@kernel
def mean_normals(
    begin: int, end: int, mesh: Connectivity, reach: i8_2d, areas: f8_2d, fields: f8_2d
):
    """Write area-weighted mean normals of vertices begin … end − 1 into ``fields`` (V, 4).

    ``reach`` is that of blocks of 3 × SKIPPED_ROWS corners.
    """
    for v in range(max(begin, 0), end):
        for k in range(FIELDS):
            fields[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, stop = rows_of_block(reach, block, 3 * SKIPPED_ROWS, len(mesh.corners), begin, end)
        for h in range(first, stop):
            v = mesh.corners[h]
            if begin <= v < end:
                f = face_of(mesh, h)
                for k in range(FIELDS):
                    fields[v, k] += areas[f, k]
    for v in range(max(begin, 0), end):
        area = fields[v, AREA]
        for k in range(3):
            fields[v, k] = fields[v, k] / area if area > 0 else 0.0
        fields[v, HEIGHT] = 0.0


@inlined
def _add_spoke(means, v, spoke, square, length):
    for k in range(3):
        means[v, UMBRELLA + k] += spoke[k]
    means[v, SQUARE] += square
    means[v, LENGTH] += length


@kernel
def mean_spokes(
    begin: int,
    end: int,
    points: f8_2d,
    edges: u4_2d,
    reach: i8_2d,
    sharp: i4_1d,
    means: f8_2d,
    valence: i4_1d,
    fields: f8_2d,
):
    """Write means over the spokes of vertices begin … end − 1, and their umbrella heights.

    The umbrella height is u · m / h_v; 0 where a sharp edge ends. ``sharp`` counts the sharp edges
    at each vertex, (0,) where there are none.
    """
    for v in range(max(begin, 0), end):
        valence[v] = 0
        for k in range(MEANS):
            means[v, k] = 0.0
    for block in range(reach.shape[0]):
        first, stop = rows_of_block(reach, block, SKIPPED_ROWS, edges.shape[0], begin, end)
        for e in range(first, stop):
            a, b = edges[e, 0], edges[e, 1]
            mine, theirs = begin <= a < end, begin <= b < end
            if not (mine or theirs):
                continue
            spoke = between(points, a, b)
            square = dot(spoke, spoke)
            length = math.sqrt(square if square > 0 else SHORTEST_SQUARE)
            if mine:
                valence[a] += 1
                _add_spoke(means, a, spoke, square, length)
            if theirs:
                valence[b] += 1
                back = -spoke[0], -spoke[1], -spoke[2]
                _add_spoke(means, b, back, square, length)
    for v in range(max(begin, 0), end):
        for k in range(MEANS):
            means[v, k] = means[v, k] / max(valence[v], 1)
        reach_of_ring = root(means[v, SQUARE])
        if reach_of_ring > 0 and (len(sharp) == 0 or sharp[v] == 0):
            fields[v, HEIGHT] = dot(row(means, v), row(fields, v)) / reach_of_ring
