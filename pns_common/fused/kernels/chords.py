"""The largest angle between some children, and how many are flipped, with child_faces.py's bits."""

from __future__ import annotations

from pns_common.fused.kernels.compiled import INDICES, LONG_INDEX, POINTS, REAL, SIZE, kernel
from pns_common.fused.kernels.normals import squared_chord, unit_normal
from pns_common.fused.kernels.vectors import dot


def _normal(points, children, f):
    return unit_normal(points, children[f, 0], children[f, 1], children[f, 2])


@kernel(REAL, POINTS, INDICES, LONG_INDEX)
def chords_inside(points, children, faces):
    """Return the largest squared chord between the middle child and the others of some faces."""
    largest = 0.0
    for f in faces:
        middle = _normal(points, children, 4 * f + 3)
        for i in range(3):
            chord = squared_chord(middle, _normal(points, children, 4 * f + i))
            largest = max(largest, chord)
    return largest


@kernel(REAL, POINTS, INDICES, LONG_INDEX, LONG_INDEX)
def chords_between(points, children, first, second):
    """Return the same between pairs of children."""
    largest = 0.0
    for e in range(first.shape[0]):
        n = _normal(points, children, first[e])
        largest = max(largest, squared_chord(n, _normal(points, children, second[e])))
    return largest


@kernel(SIZE, POINTS, POINTS, INDICES, LONG_INDEX)
def flipped_among(points, loop_points, children, faces):
    """Count the children of some faces whose normal opposes Loop's."""
    flipped = 0
    for f in faces:
        for i in range(4):
            n = _normal(points, children, 4 * f + i)
            m = _normal(loop_points, children, 4 * f + i)
            flipped += dot(n, m) < 0
    return flipped
