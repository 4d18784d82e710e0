"""Data of corners are refined as vertices are inside a chart, and stay whole along its seams."""

import numpy as np
import pytest

from pns_common import Mesh, ParameterError
from pns_common.carry.charts import refine_corners
from pns_common.schemes import CATMULL_CLARK, LOOP
from tests.support.control_points import refine
from tests.support.meshes import bumpy_sphere
from tests.support.polygons import SHAPES, cylinder, quad_grid, uneven

CLOSED = {
    "cylinder": (*cylinder(6), CATMULL_CLARK),
    "cube": (*SHAPES["cube"], CATMULL_CLARK),
    "mixed": (*SHAPES["mixed"], CATMULL_CLARK),
    "sphere of triangles": (*bumpy_sphere(), LOOP),
}


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("creased", [False, True])
def test_without_seams_corners_go_where_vertices_go(name, creased):
    points, faces, base = CLOSED[name]
    mesh = Mesh(uneven(points, by=0.02), faces)
    creases = mesh.topology().edges[:3].astype(np.int64) if creased else None
    made = refine(mesh, base.name, 2, creases=creases)
    values = mesh.vertices[mesh.corners][:, :2]
    corners = refine_corners(values, made.topologies, base)
    expected = made.mesh.vertices[made.mesh.faces][..., :2]
    np.testing.assert_array_equal(corners, expected)


def test_along_a_seam_both_sides_stay_as_they_lay():
    """Two charts that share a line of vertices: on it each side is linear, and inside it smooth."""
    points, faces = quad_grid(7)
    mesh = Mesh(points, faces)
    left = points[mesh.faces].mean(axis=1)[:, 0] < 0
    values = mesh.vertices[mesh.corners][:, :2].copy()
    values[~np.repeat(left, 4)] += [5.0, 0]
    made = refine(mesh, "catmull-clark", 2)
    corners = refine_corners(values, made.topologies, CATMULL_CLARK)
    descended = np.repeat(left, 16)
    moved = np.where(descended[:, None, None], corners, corners - [5.0, 0])
    # A linear function of the plane stays one, on both sides of the seam.
    np.testing.assert_allclose(np.ptp(corners[descended][..., 0]), 1, atol=1e-12)
    positions = made.mesh.vertices[made.mesh.faces][..., :2]
    interior = np.abs(positions).max(axis=(1, 2)) < 0.6
    np.testing.assert_allclose(moved[interior], positions[interior], atol=1e-12)


def test_one_row_for_each_corner_is_asked_for():
    mesh = Mesh(*SHAPES["cube"])
    made = refine(mesh, "catmull-clark", 1)
    with pytest.raises(ParameterError, match="corner"):
        refine_corners(np.zeros((8, 2)), made.topologies, CATMULL_CLARK)
