"""What an interior edge sees: its four points, its two face normals, its frame F = [T, N, B]."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.base.arrays import (
    Array,
    beside,
    cross,
    dot,
    gather,
    namespace,
    norm,
    unit,
    unit_longer_than,
)

# Faces are antiparallel where n1 · n2 ≤ −1 + ANTIPARALLEL (the paper's ε, section 3.2).
ANTIPARALLEL = 1e-6
# A face has no area where twice its area is below this fraction of its squared edge lengths:
# there the direction of its normal would be rounding noise.
NO_AREA = 1e-12


@dataclass(frozen=True, eq=False)
class EdgeStencil:
    """What N interior edges see.

    Attributes:
        a, b, c, d: their points.
        n1, n2: unit normals of the faces of c and of d.
        fields: M numbers for each of a, b, c, d, where the features ask for vertex data.
    """

    a: Float[Array, "N 3"]
    b: Float[Array, "N 3"]
    c: Float[Array, "N 3"]
    d: Float[Array, "N 3"]
    n1: Float[Array, "N 3"]
    n2: Float[Array, "N 3"]
    fields: Float[Array, "N 4 M"] | None = None


@dataclass(frozen=True, eq=False)
class EdgeFrames:
    """Frames of N interior edges.

    Attributes:
        tangent, normal, binormal: the columns T, N, B of F ∈ SO(3).
        length: h = ‖b − a‖.
        curvature: x = 1 − n1 · n2 ∈ [0, 2]; 0 where a normal is undefined.
        degenerate: zero length, a face of zero area, or antiparallel faces: F is the fallback.
    """

    tangent: Float[Array, "N 3"]
    normal: Float[Array, "N 3"]
    binormal: Float[Array, "N 3"]
    length: Float[Array, " N"]
    curvature: Float[Array, " N"]
    degenerate: Bool[Array, " N"]


def face_normals(points: Float[Array, "V 3"], faces: Int[np.ndarray, "F 3"]) -> Float[Array, "F 3"]:
    """Return unit normals (b − a) × (c − a), faces anticlockwise from outside; 0 without area."""
    return triangle_normals(*(gather(points, faces[:, corner]) for corner in range(3)))


def triangle_normals(
    a: Float[Array, "N 3"], b: Float[Array, "N 3"], c: Float[Array, "N 3"]
) -> Float[Array, "N 3"]:
    """Return the unit normals of triangles; 0 where they have no area."""
    u, v = b - a, c - a
    return unit_longer_than(cross(u, v), NO_AREA * (dot(u, u) + dot(v, v)))


def edge_stencil(
    points: Float[Array, "V 3"],
    normals: Float[Array, "F 3"],
    stencil: Int[np.ndarray, "N 4"],
    edge_faces: Int[np.ndarray, "N 2"],
    fields: Float[Array, "V M"] | None = None,
) -> EdgeStencil:
    """Gather the points, face normals and vertex data of interior edges.

    ``stencil`` and ``edge_faces`` are rows of the topology's tables or of an orientation's.
    """
    a, b, c, d = (gather(points, stencil[:, column]) for column in range(4))
    n1, n2 = (gather(normals, edge_faces[:, column]) for column in range(2))
    return EdgeStencil(a, b, c, d, n1, n2, None if fields is None else gather(fields, stencil))


def edge_frames(stencil: EdgeStencil) -> EdgeFrames:
    """Return F = [T, N, B]: T along the edge, N its mean face normal, B = T × N (section 3.2).

    Degenerate edges take a fixed world triad, so that F is a rotation for every input; there, and
    only there, F does not turn with the mesh.
    """
    xp = namespace(stencil.a)
    edge = stencil.b - stencil.a
    length = norm(edge)
    cosine = dot(stencil.n1, stencil.n2)
    undefined = (
        (length == 0) | (dot(stencil.n1, stencil.n1) == 0) | (dot(stencil.n2, stencil.n2) == 0)
    )
    degenerate = undefined | (cosine <= -1 + ANTIPARALLEL)
    triad = beside(stencil.a, np.eye(3), stencil.a.dtype)

    tangent = unit(edge)
    mean_normal = xp.where(degenerate[:, None], triad[1], stencil.n1 + stencil.n2)
    tangent = xp.where(degenerate[:, None], triad[0], tangent)
    normal = unit(mean_normal - dot(mean_normal, tangent)[:, None] * tangent)
    return EdgeFrames(
        tangent=tangent,
        normal=normal,
        binormal=cross(tangent, normal),
        length=length,
        curvature=xp.where(undefined, 0.0, 1 - cosine),
        degenerate=degenerate,
    )


def shut_where_degenerate(stencil: EdgeStencil) -> EdgeFrames:
    """Return edge frames with x = 0 where degenerate: no gate opens where F would not turn along.

    Antiparallel faces are among them, where x would be 2.
    """
    frames = edge_frames(stencil)
    curvature = namespace(stencil.a).where(frames.degenerate, 0.0, frames.curvature)
    return replace(frames, curvature=curvature)


def rotate(frames: EdgeFrames, local: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    """Return F η: local coordinates (along T, N, B) turned to world coordinates."""
    return (
        local[:, :1] * frames.tangent
        + local[:, 1:2] * frames.normal
        + local[:, 2:] * frames.binormal
    )
