"""Bounds of the distance between triangles with corners on the limit surface and their patches.

The patch of a face is the part of the limit surface that the face becomes. Its slab is how far it
reaches to both sides of the plane of its triangle; where a side is sharp, also how far its curve
reaches from the side, along the normal and across (kernels/flatness.py).
docs/explanation/adaptive.md proves the bounds, and says what they promise.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.adaptive.parts import CHILDREN, Levels, Part
from pns_common.kernels import connectivity
from pns_common.kernels import flatness as kernels
from pns_common.kernels.connectivity import INTERIOR
from pns_common.kernels.flatness import HALF
from pns_common.mesh.creases import edge_cosines
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import Topology

# The side of a face that each side of its children is half of, from (a, ab, ca) on, or NO_SIDE.
OF_CHILDREN = np.array([[0, 3, 2], [1, 3, 0], [2, 3, 1], [3, 3, 3]])
NO_SIDE = 3
CURVE, CORNER = 2, 3
# Sides are measured as curves where faces turn by more than 60 degrees, in cosines.
FOLD = 1 / 2
# All but the curve's own rule has so much weight on a curve at most, in units of 1 − w.
OF_RING = 1.65


def slabs(
    part: Part,
    faces: Integer[np.ndarray, " N *D"],
    triangles: Float[np.ndarray, "N 3 3"],
    sides: Bool[np.ndarray, "N 3"],
    levels: Levels,
    deeper: int,
) -> Float[np.ndarray, "N 14"]:
    """Return the slabs of faces about their triangles.

    Args:
        part: the faces, or what they become so many levels deeper.
        faces: rows of the faces, or of all 4 ** deeper that each becomes.
        triangles: corners of the faces, on the limit surface.
        sides: which sides are to be measured as curves: see ``folded``.
        levels: the rules.
        deeper: 0, 1 or 2.
    """
    count, each = len(faces), CHILDREN**deeper
    of_face = sides_of_descendants(deeper)
    asked = np.hstack([sides, np.zeros((count, 1), dtype=bool)])[:, of_face]
    compared = np.ascontiguousarray(np.where(asked, of_face, -1).reshape(-1, 3), dtype=np.int32)
    made = _measured(part, faces.reshape(-1), triangles.repeat(each, axis=0), compared, levels)
    made = made.reshape(count, each, kernels.COLUMNS)
    low, high = made[:, :, ::2].min(axis=1), made[:, :, 1::2].max(axis=1)
    return np.stack([low, high], axis=2).reshape(count, kernels.COLUMNS)


@cache
def sides_of_descendants(deeper: int) -> Integer[np.ndarray, "D 3"]:
    """Return the side of a face that each side of its descendants is a piece of, or NO_SIDE."""
    made = np.array([[0, 1, 2]])
    for _ in range(deeper):
        made = np.hstack([made, np.full((len(made), 1), NO_SIDE)])[:, OF_CHILDREN].reshape(-1, 3)
    return made


def folded(part: Part) -> Bool[np.ndarray, "F 3"]:
    """Return the sides of faces beyond which no neighbour's slab bounds what reaches over them."""
    mesh = part.topology
    rim = (mesh.edge_class == connectivity.BOUNDARY) | (mesh.edge_class == connectivity.IRREGULAR)
    return (rim | (edge_cosines(part.points, mesh) < FOLD))[mesh.face_edges]


def distances(slabs: Float[np.ndarray, "N 14"]) -> Float[np.ndarray, " N"]:
    """Return how far patches can be from their triangles."""
    return _farthest(np.maximum(-slabs[:, ::2], slabs[:, 1::2]))


def cut_distances(
    slabs: Float[np.ndarray, "N 14"],
    triangles: Float[np.ndarray, "N 3 3"],
    middles: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, " N"]:
    """Return how far patches can be from their triangles if these are cut at points of them.

    The cut raises a triangle by 0 to the point's height. Where that is not known (NaN) it lies in
    the slab, so both are apart by no more than the slab is wide.
    """
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0, lengths, 1.0)
    height = np.einsum("ij,ij->i", middles - triangles[:, 0], normals)
    sizes = slabs[:, 1::2] - slabs[:, ::2]
    up, down = np.maximum(height, 0), np.minimum(height, 0)
    known = np.maximum(slabs[:, 1] - down, up - slabs[:, 0])
    sizes[:, 0] = np.where(np.isnan(height), sizes[:, 0], known)
    return _farthest(sizes)


def _farthest(sizes: Float[np.ndarray, "N 7"]) -> Float[np.ndarray, " N"]:
    sides = np.hypot(sizes[:, 1::2], sizes[:, 2::2]).max(axis=1, initial=0.0)
    return np.maximum(sizes[:, 0], sides)


def _measured(
    part: Part,
    faces: Integer[np.ndarray, " N"],
    triangles: Float[np.ndarray, "N 3 3"],
    sides: Integer[np.ndarray, "N 3"],
    levels: Levels,
) -> Float[np.ndarray, "N 14"]:
    mesh = part.topology if levels.lasting else part.topology.without_creases()
    made = np.empty((len(faces), kernels.COLUMNS))
    read = part.points, mesh.corners, *_influences(mesh), *_rules(mesh)
    at = faces.astype(np.int64), np.ascontiguousarray(triangles).reshape(-1, 3), sides
    soft = 1 - mesh.sharpness[mesh.face_edges[faces]]
    levels.blocks.quiet().run(
        len(faces),
        lambda begin, end: kernels.measure_slabs(*read, *at, soft, begin, end, made),
    )
    return made


def _rules(
    mesh: Topology,
) -> tuple[Integer[np.ndarray, " V"], Integer[np.ndarray, "V 2"], Float[np.ndarray, " V"]]:
    """Return what vertices do at all levels from here on, mostly.

    Return the neighbours of those on curves too, and the weight that all else can have.
    """
    moves, slack = np.full(mesh.vertex_count, kernels.FREE, dtype=np.int8), np.zeros(0)
    sharp = mesh.sharpest
    if sharp is None:
        return moves, np.zeros((mesh.vertex_count, 2), np.uint32), np.zeros(mesh.vertex_count)
    # Corners that wear off are no corners.
    lasting = replace(mesh, vertex_sharpness=np.where(np.isinf(mesh.vertex_sharpness), np.inf, 0.0))
    weights = lasting.sharpest.weights if lasting.sharpest is not None else 0 * sharp.weights
    moves[weights[:, 1] > HALF] = kernels.ON_CURVE
    moves[weights[:, 2] > HALF] = kernels.STAYS
    at = np.where(moves == kernels.STAYS, weights[:, 2], weights[:, 1])
    slack = np.where(moves == kernels.FREE, 0.0, OF_RING * (1 - at))
    return moves, np.ascontiguousarray(sharp.neighbours), slack


def _influences(mesh: Topology) -> tuple[np.ndarray, ...]:
    """Return what corners read on their side of edges that are mostly sharp.

    Return the group of each corner, where each group begins, the corners of all groups, the weight
    that what lies beyond a corner's group can have; and the same of vertices, where each begins and
    the corners. A vertex on fewer than two such edges, or where several fans meet, reads all around
    it.
    """
    marked = mesh.with_creases(np.flatnonzero(mesh.is_sharp))
    around, corners = find_sectors(marked), mesh.corners.astype(np.int64)
    divided: Bool[np.ndarray, " V"] = np.zeros(mesh.vertex_count, dtype=bool)
    if len(marked.sharp_count):
        divided = marked.sharp_count >= CURVE
        divided &= ~((marked.sharp_count == CURVE) & mesh.multi_fan_vertices)
    label = np.where(divided[corners], around.of_corner, len(around.first) + corners)
    _, group = np.unique(label, return_inverse=True)
    group = group.reshape(-1).astype(np.int32)
    starts, members = _gathered(group, int(group.max(initial=-1)) + 1)
    # The least sharp of the edges that bound a group.
    count = len(starts) - 1
    slack, loose = np.zeros(count), np.where(marked.edge_class == INTERIOR, 0.0, 1 - mesh.sharpness)
    edges = mesh.face_edges
    for ends in (edges, np.roll(edges, 1, axis=1)):
        np.maximum.at(slack, group, loose[ends.reshape(-1)])
    slack = np.where(divided[corners], slack[group], 0.0)
    return group, starts, members, slack, *_gathered(corners, mesh.vertex_count)


def _gathered(
    groups: Integer[np.ndarray, " H"], count: int
) -> tuple[Integer[np.ndarray, " G1"], Integer[np.ndarray, " H"]]:
    """Return where the corners of each group begin, and all corners, group after group."""
    members = np.argsort(groups, kind="stable").astype(np.int64)
    starts = np.searchsorted(groups[members], np.arange(count + 1))
    return starts.astype(np.int64), members
