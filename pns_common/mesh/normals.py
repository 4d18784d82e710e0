"""Normals of faces and of groups of corners; tangents at a right angle to them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Integer

from pns_common.kernels import measures
from pns_common.kernels import normals as kernels
from pns_common.mesh.rows import number_by_first_appearance
from pns_common.mesh.sectors import find_sectors
from pns_common.mesh.topology import TRIANGLE, Topology, build_topology
from pns_common.parallel import Blocks

NO_AREAS = np.zeros((0, 4))
# A face that is one triangle.
ONE_TRIANGLE = np.array([[0, 1, 2]])


def face_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Integer[np.ndarray, "F N"],
    blocks: Blocks | None = None,
) -> Float[np.ndarray, "F 3"]:
    """Return the unit normals of triangles, or of quads; 0 without area."""
    normals, blocks = np.empty((len(faces), 3)), blocks or Blocks()
    if faces.shape[1] == TRIANGLE:
        blocks.run(len(faces), measures.measure_faces, points, faces, normals, NO_AREAS)
    else:
        blocks.run(len(faces), measures.measure_quads, points, faces, normals)
    return normals


def measure_faces(
    points: Float[np.ndarray, "V 3"], topology: Topology, blocks: Blocks, *, areas: bool
) -> tuple[Float[np.ndarray, "F 3"], Float[np.ndarray, "A 4"]]:
    """Return unit normals of faces of any degree, and if asked twice the area vectors and lengths.

    A polygon's area vector is that of any fan of triangles over it (Newell); normals are 0 without
    area.
    """
    count, mesh = topology.face_count, topology
    normals, vectors = np.empty((count, 3)), np.empty((count if areas else 0, 4))
    measure = measures.measure_faces if mesh.triangles else measures.measure_polygons
    faces = mesh.faces if mesh.triangles else mesh.connectivity
    blocks.run(count, measure, points, faces, normals, vectors)
    return normals, vectors


def angle_weighted_normals(
    points: Float[np.ndarray, "V 3"],
    faces: Integer[np.ndarray, "F T"],
    groups: Integer[np.ndarray, "F T"],
    count: int,
    blocks: Blocks,
    triangles: Integer[np.ndarray, "D 3"] = ONE_TRIANGLE,
) -> Float[np.ndarray, "G 3"]:
    """Return the unit normal of each group of corners; 0 without area, or where all cancel out.

    The faces' own normals are weighted by their angles at the corner (Thürmer and Wüthrich 1998):
    however a flat side is cut into triangles, it weighs the same. Triangles that are turned over
    against their face as a whole do not count.

    Args:
        points: positions.
        faces: T points of each face.
        groups: the group, 0 … count − 1, of each of these.
        count: number of groups.
        blocks: how the work is shared.
        triangles: columns of ``faces`` that each of a face's D triangles has at its corners.
    """
    made = len(faces) * len(triangles)
    normals, angles, total = np.empty((made, 3)), np.empty((made, 2)), np.zeros((count, 3))
    read = points, faces, triangles
    blocks.run(len(faces), kernels.measure_triangles, *read, normals, angles)
    kernels.add_corners(normals, angles, groups, triangles, total)
    # Blocks of groups, not of faces of many triangles.
    Blocks(blocks.threads).run(count, kernels.scale_to_unit, total)
    return total


def opposed_corners(
    points: Float[np.ndarray, "N 3"],
    normals: Float[np.ndarray, "N 3"],
    faces: Integer[np.ndarray, "F 3"],
    blocks: Blocks,
) -> Bool[np.ndarray, "F 3"]:
    """Return the corners whose normal is more than 90 degrees off their triangle's own."""
    opposed = np.empty((len(faces), 3), dtype=np.bool_)
    blocks.run(len(faces), kernels.mark_opposed, points, normals, faces, opposed)
    return opposed


def smooth_fans(
    faces: Integer[np.ndarray, "F 3"], vertex_count: int, creases: Integer[np.ndarray, "N 2"] | None
) -> Integer[np.ndarray, "F 3"]:
    """Return the smooth fan of each corner, numbered by first appearance.

    A fan is a run of faces around a vertex that follow one another across edges that are neither
    creases, boundaries nor irregular; its corners can share a normal. ``creases`` are pairs of
    vertices, each an edge.
    """
    topology = build_topology(faces, vertex_count)
    if creases is not None:
        topology = topology.with_creases(topology.rows_of(creases))
    around = find_sectors(topology.connectivity)
    return number_by_first_appearance(around.of_corner)[0].reshape(-1, TRIANGLE)


def perpendicular_tangents(
    tangents: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], blocks: Blocks
) -> Float[np.ndarray, "N 3"]:
    """Return the tangents' unit projections onto the planes of the unit normals.

    Where a tangent lies along its normal, any perpendicular serves; this takes one from the axis
    that the normal is farthest from.
    """
    made = np.empty(tangents.shape)
    given = [np.ascontiguousarray(part, dtype=np.float64) for part in (tangents, normals)]
    blocks.run(len(made), kernels.perpendicular_tangents, *given, made)
    return made
