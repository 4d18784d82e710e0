"""Crease lines of small meshes."""

import numpy as np

from pns_common import Creases, Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import CREASE_ANGLE, EDGED_ANGLE, line_rows
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.geometry.frames import face_normals
from tests.support.meshes import grid, prism

SHARP_ALONE = Creases(line_angle=CREASE_ANGLE)
WITH_GENTLE = Creases(line_angle=CREASE_ANGLE, edged_angle=EDGED_ANGLE)
# All turns beyond 66 degrees but at the two edges of the chamfer, which turn by 45.
CHAMFERED = prism([[0, 0], [2, 0], [2, 1.5], [1.5, 2], [0, 2]])
# Its ends are one triangle each.
WEDGE = prism([[0, 0], [2, 0], [0, 1]])
# A plate on another, and a rib between them; x is along the lower one, y along the corner.
# fmt: off
RIB = Mesh(
    np.array([
        0, -4, 0, 0, -4, 10, 0, 4, 0, 0, 4, 10, 1, -4, 1, 1, -4, 10, 1, -1, 1, 1, -1, 8, 1, 1, 1,
        1, 1, 8, 1, 4, 1, 1, 4, 10, 8, -1, 1, 8, 1, 1, 10, -4, 0, 10, -4, 1, 10, 4, 0, 10, 4, 1,
    ], dtype=float).reshape(-1, 3),
    np.array([
        1, 2, 0, 1, 3, 2, 14, 4, 0, 1, 0, 4, 5, 1, 4, 15, 4, 14, 16, 0, 2, 16, 14, 0, 3, 10, 2,
        16, 2, 10, 17, 16, 10, 11, 10, 3, 3, 1, 5, 11, 3, 5, 9, 8, 10, 9, 10, 11, 7, 4, 6, 5, 7, 9,
        5, 9, 11, 5, 4, 7, 12, 6, 4, 12, 4, 15, 13, 10, 8, 17, 13, 12, 17, 12, 15, 17, 10, 13,
        14, 16, 17, 15, 14, 17, 13, 8, 9, 9, 7, 12, 9, 12, 13, 12, 7, 6,
    ]).reshape(-1, 3),
)
# fmt: on


def lines(mesh, creases=SHARP_ALONE):
    return _pairs(mesh, creases)[0]


def held(mesh, creases=SHARP_ALONE):
    """Return what is held beside the lines."""
    found, all_sharp = _pairs(mesh, creases)
    return all_sharp - found


def _pairs(mesh, creases):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    around = mesh.vertices, normals_of(mesh), topology
    rows = line_rows(*around, creases)
    both = rows, with_held_edges(*around, rows)
    return [{tuple(pair) for pair in topology.edges[rows].tolist()} for rows in both]


def normals_of(mesh):
    return face_normals(mesh.vertices, mesh.faces)


def pleat(degrees, cells=4):
    """A sheet of so many by so many cells, folded once along its middle row."""
    points, faces = grid(cells + 1)
    half, y = np.radians(degrees) / 2, points[:, 1]
    folded = np.stack([points[:, 0], y * np.cos(half), -np.abs(y) * np.sin(half)], axis=1)
    return Mesh(folded, faces)


def tube(sides, across, rows=4):
    """An open tube of plane walls, each of so many quads across, all cut the same way."""
    corners = 2 * np.pi * np.arange(sides) / sides
    corners = np.stack([np.cos(corners), np.sin(corners)], axis=1)
    way = (np.arange(across) / across)[:, None]
    around = corners[:, None] * (1 - way) + np.roll(corners, -1, axis=0)[:, None] * way
    count, heights = sides * across, np.linspace(0, 2, rows + 1)
    rim = np.tile(around.reshape(-1, 2), (rows + 1, 1))
    i, j = (axis.ravel() for axis in np.mgrid[:rows, :count])
    a, b = i * count + j, i * count + (j + 1) % count
    faces = np.stack([a, b, b + count, a, b + count, a + count], axis=1).reshape(-1, 3)
    return Mesh(np.c_[rim, np.repeat(heights, count)], faces)
