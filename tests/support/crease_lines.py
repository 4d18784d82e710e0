"""Crease lines of small meshes."""

from pns_common import Creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import CREASE_ANGLE, EDGED_ANGLE, line_rows
from pns_common.geometry.crease_lines.held_edges import with_held_edges
from pns_common.geometry.frames import face_normals
from tests.support.meshes import prism

SHARP_ALONE = Creases(line_angle=CREASE_ANGLE)
WITH_GENTLE = Creases(line_angle=CREASE_ANGLE, edged_angle=EDGED_ANGLE)
# All turns beyond 66 degrees but at the two edges of the chamfer, which turn by 45.
CHAMFERED = prism([[0, 0], [2, 0], [2, 1.5], [1.5, 2], [0, 2]])
# Its ends are one triangle each.
WEDGE = prism([[0, 0], [2, 0], [0, 1]])


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
