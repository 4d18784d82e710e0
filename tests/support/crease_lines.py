"""Crease lines of small meshes."""

from pns_common import Creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import CREASE_ANGLE, EDGED_ANGLE, line_rows
from pns_common.geometry.frames import face_normals
from tests.support.meshes import prism

SHARP_ALONE = Creases(line_angle=CREASE_ANGLE)
WITH_GENTLE = Creases(line_angle=CREASE_ANGLE, edged_angle=EDGED_ANGLE)
# All turns beyond 66 degrees but at the two edges of the chamfer, which turn by 45.
CHAMFERED = prism([[0, 0], [2, 0], [2, 1.5], [1.5, 2], [0, 2]])


def lines(mesh, creases=SHARP_ALONE):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = line_rows(mesh.vertices, normals_of(mesh), topology, creases)
    return {tuple(pair) for pair in topology.edges[rows]}


def normals_of(mesh):
    return face_normals(mesh.vertices, mesh.faces)
