"""Normals and tangents at corners.

Angles are made of products, sums and quotients alone: the same bits on any processor. Arctangents
of C libraries differ from one to the next. After Cephes (Moshier 1989):

    arctan t ≈ t + t z P(z) / Q(z),   z = t²,   for |t| ≤ 0.66

Steeper ones are taken from π/4 or π/2. The relative error is below 2⁻⁵¹.
"""

from __future__ import annotations

import math

from pns_common.kernels import b1_2d, f4_2d, f8_2d, i4_2d, i8_2d, inlined, kernel
from pns_common.kernels.vectors import across, between, cross, divisor, dot, norm, over, row

# Unit vectors whose weighted sum is shorter have no direction to trust.
NO_DIRECTION = 1e-9
# Cosines of single precision that are no less than 0.
ROUNDED = 1e-5
HALF_PI, QUARTER_PI = math.pi / 2, math.pi / 4
# What π/2 and π/4 as numbers leave out.
LEFT_OF_HALF, LEFT_OF_QUARTER = 6.123233995736766e-17, 3.061616997868383e-17
# Up to the first, tangents count from 0; beyond the second, which is tan 3π/8, from π/2.
GENTLE, STEEP = 0.66, 2.414213562373095
P0, P1, P2 = -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1
P3, P4 = -1.615753718733365076637e1, -8.750608600031904122785e-1
# The first coefficient of Q is 1.
Q0, Q1, Q2 = 1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2
Q3, Q4 = 1.650270098316988542046e2, 2.485846490142306297962e1


@inlined
def angle_between(sine, cosine):
    """Return the angle, 0 … π, of a sine ≥ 0 and a cosine, both times any one factor ≥ 0.

    It is 0 where both are 0.
    """
    size = abs(cosine)
    gentle, steep = sine <= GENTLE * size, sine > STEEP * size
    above = sine if gentle else -size if steep else sine - size
    below = size if gentle else sine if steep else sine + size
    t = above / (below if below > 0 else 1.0)
    z = t * t
    p = (((P4 * z + P3) * z + P2) * z + P1) * z + P0
    q = ((((z + Q4) * z + Q3) * z + Q2) * z + Q1) * z + Q0
    base = 0.0 if gentle else HALF_PI if steep else QUARTER_PI
    left = 0.0 if gentle else LEFT_OF_HALF if steep else LEFT_OF_QUARTER
    acute = base + (t * (z * p / q) + t + left)
    return math.pi - acute if cosine < 0 else acute


@kernel
def mark_opposed(
    begin: int,
    end: int,
    points: f4_2d | f8_2d,
    normals: f4_2d,
    faces: i4_2d | i8_2d,
    opposed: b1_2d,
):
    """Mark the corners of faces begin … end − 1 whose normal is more than 90 degrees off."""
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        area = cross(between(points, a, b), between(points, a, c))
        least = -ROUNDED * norm(area)
        for corner in range(3):
            opposed[f, corner] = dot(row(normals, faces[f, corner]), area) < least


@kernel
def measure_triangles(
    begin: int,
    end: int,
    points: f8_2d,
    faces: i4_2d | i8_2d,
    triangles: i8_2d,
    normals: f8_2d,
    angles: f8_2d,
):
    """Write unit normals and angles of the triangles of faces begin … end − 1.

    Normals are 0 without area, and where a triangle is turned over against its face as a whole: a
    fold, however small, has angles as wide as any.

    Args:
        faces: (F, T) points of each face.
        triangles: (D, 3) columns of ``faces`` that each of its triangles has at its corners.
        normals: (F D, 3) out.
        angles: (F D, 2) out: at the first two corners.
    """
    count = triangles.shape[0]
    for f in range(begin, end):
        whole = 0.0, 0.0, 0.0
        for d in range(count):
            a, b = faces[f, triangles[d, 0]], faces[f, triangles[d, 1]]
            c = faces[f, triangles[d, 2]]
            ab, bc, ca = between(points, a, b), between(points, b, c), between(points, c, a)
            vector = cross(ca, ab)
            twice_area = norm(vector)
            whole = whole[0] + vector[0], whole[1] + vector[1], whole[2] + vector[2]
            normal = over(vector, twice_area if twice_area > 0 else 1.0)
            i = f * count + d
            for k in range(3):
                normals[i, k] = normal[k]
            angles[i, 0] = angle_between(twice_area, -dot(ab, ca))
            angles[i, 1] = angle_between(twice_area, -dot(bc, ab))
        for i in range(f * count, (f + 1) * count):
            if dot(row(normals, i), whole) < 0:
                for k in range(3):
                    normals[i, k] = 0.0


@kernel
def add_corners(
    normals: f8_2d, angles: f8_2d, groups: i4_2d | i8_2d, triangles: i8_2d, total: f8_2d
):
    """Add normals of triangles, times their angles, to the groups of their corners, in order."""
    count = triangles.shape[0]
    for f in range(groups.shape[0]):
        for d in range(count):
            i = f * count + d
            at = angles[i, 0], angles[i, 1], math.pi - angles[i, 0] - angles[i, 1]
            for corner in range(3):
                g = groups[f, triangles[d, corner]]
                for k in range(3):
                    total[g, k] += at[corner] * normals[i, k]


@kernel
def scale_to_unit(begin: int, end: int, total: f8_2d):
    """Scale rows begin … end − 1 to length 1; to zeros where they have no direction."""
    for g in range(begin, end):
        vector = row(total, g)
        length = norm(vector)
        for k in range(3):
            total[g, k] = vector[k] / length if length > NO_DIRECTION else 0.0


@kernel
def perpendicular_tangents(begin: int, end: int, tangents: f8_2d, normals: f8_2d, made: f8_2d):
    """Write the unit projections of tangents begin … end − 1 onto the planes of unit normals."""
    for r in range(begin, end):
        tangent, normal = row(tangents, r), row(normals, r)
        flat = across(tangent, normal)
        if norm(flat) <= NO_DIRECTION * max(norm(tangent), NO_DIRECTION):
            flat = across(_farthest_axis(normal), normal)
        flat = over(flat, divisor(flat))
        for k in range(3):
            made[r, k] = flat[k]


@inlined
def _farthest_axis(normal):
    """Return the axis that a normal is farthest from."""
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    if z < min(x, y):
        return 0.0, 0.0, 1.0
    return (0.0, 1.0, 0.0) if y < x else (1.0, 0.0, 0.0)
