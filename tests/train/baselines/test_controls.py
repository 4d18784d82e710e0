"""The untrained controls, against their definitions worked out otherwise."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.rules.control_level import control_level
from pns_common.schemes import loop
from train.baselines.controls import flat, nc
from train.data.primitives import box, globe, icosphere, torus
from train.surfaces.quasi_interpolation import limit_positions, n1, q1, vertex_normals

SHAPES = {"torus": torus(7, 5), "globe": globe(9, 4), "box": box(1, 2, 3)}


@pytest.fixture(params=SHAPES)
def mesh(request):
    return SHAPES[request.param]


def level_of(mesh):
    return control_level(mesh.vertices, build_topology(mesh.faces, len(mesh.vertices)))


def test_limit_positions_are_where_many_levels_of_loop_lead(mesh):
    deep = refine(mesh, loop(), 6, threads=1).mesh.vertices[: len(mesh.vertices)]
    limit = limit_positions(level_of(mesh))
    np.testing.assert_allclose(limit, deep, atol=3e-4 * np.ptp(mesh.vertices))


def test_limit_positions_on_an_open_mesh_follow_its_boundary():
    patch = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [2, 0, 1], [0, 1, 0], [1, 1, 0.0], [2, 1, 0]]),
        np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]),
    )
    deep = refine(patch, loop(), 7, threads=1).mesh.vertices[:6]
    np.testing.assert_allclose(limit_positions(level_of(patch)), deep, atol=1e-4)


def test_flat_refines_nothing(mesh):
    refined = refine(mesh, flat(), 2, threads=1).mesh
    assert len(refined.faces) == 16 * len(mesh.faces)
    ends = mesh.vertices[build_topology(mesh.faces, len(mesh.vertices)).edges]
    once = refine(mesh, flat(), 1, threads=1).mesh.vertices
    np.testing.assert_array_equal(once[: len(mesh.vertices)], mesh.vertices)
    np.testing.assert_allclose(once[len(mesh.vertices) :], ends.mean(axis=1), atol=1e-15)


def test_q1_and_n1_are_loop_on_pushed_control_meshes(mesh):
    level = level_of(mesh)
    push = mesh.vertices - limit_positions(level)
    normal = vertex_normals(level)
    along = (push * normal).sum(axis=1, keepdims=True) * normal
    for scheme, moved in ((q1(), push), (n1(), along)):
        expected = refine(Mesh(mesh.vertices + moved, mesh.faces), loop(), 3, threads=1).mesh
        refined = refine(mesh, scheme, 3, threads=1).mesh
        np.testing.assert_allclose(refined.vertices, expected.vertices, atol=1e-13)


def test_n1_holds_a_sphere_that_loop_shrinks():
    sphere = icosphere(1)
    radius = {
        name: np.linalg.norm(refine(sphere, scheme, 3, threads=1).mesh.vertices, axis=1).mean()
        for name, scheme in (("loop", loop()), ("n1", n1()), ("nc", nc()))
    }
    assert radius["loop"] < radius["nc"] < radius["n1"]
    assert abs(radius["n1"] - 1) < 0.2 * abs(radius["loop"] - 1)


def test_nc_is_loop_on_a_plane_and_at_reference_length_zero():
    grid = Mesh(
        np.array([[x + 0.3, y, 0.0] for x in range(4) for y in range(4)]),
        np.array(
            [
                face
                for i in range(3)
                for j in range(3)
                for face in (
                    (4 * i + j, 4 * i + j + 4, 4 * i + j + 5),
                    (4 * i + j, 4 * i + j + 5, 4 * i + j + 1),
                )
            ]
        ),
    )
    expected = refine(grid, loop(), 2, threads=1).mesh.vertices
    np.testing.assert_allclose(refine(grid, nc(), 2, threads=1).mesh.vertices, expected, atol=1e-15)
    point = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert not refine(point, nc(), 1, threads=1).mesh.vertices.any()


def test_nc_stays_within_its_budget():
    mesh = torus(7, 5)
    corrected, base = (
        refine(mesh, scheme, 1, 50.0, threads=1).mesh.vertices for scheme in (nc(), loop())
    )
    ends = mesh.vertices[build_topology(mesh.faces, len(mesh.vertices)).edges]
    square = ((ends[:, 0] - ends[:, 1]) ** 2).sum(axis=1)
    away = np.linalg.norm(corrected - base, axis=1)
    count = len(mesh.vertices)
    assert (away[count:] <= 0.8 / 50 * square * (1 + 1e-12)).all()
    assert away[count:].max() > 0.5 * 0.8 / 50 * square.max()
