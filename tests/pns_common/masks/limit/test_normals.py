"""Normals of the limit surface: known on simple surfaces, and where many steps lead."""

import numpy as np
import pytest

from pns_common import Mesh, loop, refine
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.frames import face_normals
from pns_common.masks.limit import limit_normals
from pns_common.masks.limit.normals import means_of_units, plane_normals
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere


def test_on_a_sphere_normals_point_outwards_and_on_a_plane_along_its_normal():
    points, faces = icosphere(2)
    normals = limit_normals(points, build_topology(faces, len(points))).vertices
    assert np.sum(normals * points, axis=1).min() > np.cos(0.03)
    flat, faces = grid(5)
    normals = limit_normals(flat, build_topology(faces, len(flat))).vertices
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (len(flat), 1)), atol=1e-14)


def test_both_sides_of_a_crease_have_their_own_normal():
    """A roof: its ridge is a crease, and the slopes stay flat beside it."""
    points, faces = grid(5, lambda x, y: -np.abs(x))
    topology = build_topology(faces, len(points))
    ridge = np.flatnonzero(points[:, 0] == 0)
    topology = with_creases(topology, np.stack([ridge[:-1], ridge[1:]], axis=1))
    normals = limit_normals(points, topology)
    middle = ridge[2]
    sides = normals.sectors[normals.sector_of_corner][topology.faces.reshape(-1) == middle]
    slopes = np.unique(np.round(sides * np.sqrt(2), 9), axis=0)
    np.testing.assert_allclose(slopes, [[-1, 0, 1], [1, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(normals.vertices[middle], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("mesh", [bumpy_sphere(3), grid(5, bent), icosphere(0)])
def test_normals_are_those_of_the_faces_of_a_deep_refinement(mesh):
    points, faces = mesh
    deep = refine(Mesh(points, faces), loop(), 6).mesh
    topology = build_topology(np.array(faces), len(points))
    exact = limit_normals(points, topology).vertices
    normals = face_normals(deep.vertices, deep.faces)
    for v in range(len(points)):
        around = normals[(deep.faces == v).any(axis=1)]
        assert (around @ exact[v]).min() > np.cos(0.06)


def test_a_corner_wider_than_half_a_turn_looks_where_its_faces_do():
    """Three creases meet in a plane: sectors of 45, 45 and 270 degrees."""
    angle = np.pi / 4 * np.arange(8)
    points = np.concatenate([[[0.0, 0, 0]], np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)])
    around = np.arange(8)
    faces = np.stack([0 * around, 1 + around, 1 + (around + 1) % 8], axis=1)
    topology = with_creases(build_topology(faces, 9), np.array([[0, 1], [0, 2], [0, 3]]))
    normals = limit_normals(points, topology)
    assert len(np.unique(normals.sector_of_corner[::3])) == 3
    np.testing.assert_allclose(normals.sectors[:, 2], 1, atol=1e-12)


def test_on_a_curve_the_masks_say_which_way_is_out_and_not_the_faces():
    """A steep fan, most of whose area looks the other way: deep refinement looks as they say."""
    angle, rng = np.linspace(0, np.pi, 4), np.random.default_rng(0)
    faces, against = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]]), 0
    for heights in rng.normal(0, 3, (100, 5)):
        points = np.column_stack([[0, *np.cos(angle)], [0, *np.sin(angle)], heights])
        normal = limit_normals(points, build_topology(faces, 5)).vertices[0]
        spokes = points[faces[:, 1:]] - points[0]
        if np.cross(spokes[:, 0], spokes[:, 1]).sum(axis=0) @ normal < 0:
            against += 1
            deep = refine(Mesh(points, faces), loop(), 6).mesh
            around = face_normals(deep.vertices, deep.faces)[(deep.faces == 0).any(axis=1)]
            assert (around @ normal).min() > 0.99
    assert against


def test_tangents_that_span_no_plane_leave_it_to_the_faces():
    first, second = np.array([[1.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 2, 0], [3, 0, 0]])
    area = np.array([[0.0, 0, -5], [0, -4, 0]])
    assert plane_normals(first, second, area).tolist() == [[0, 0, 1], [0, -1, 0]]
    # A corner wider than half a turn: its faces say which way is out.
    assert plane_normals(first, second, area, np.array([True, False]))[0].tolist() == [0, 0, -1]


@pytest.mark.parametrize("creased", [False, True])
def test_normals_that_cancel_are_zero(creased):
    """Of a sheet that is there from both sides none is left, however it lies."""
    rng = np.random.default_rng(0)
    points, faces = grid(5, lambda x, y: rng.uniform(-0.3, 0.3, x.shape))
    mesh = Mesh(points, np.concatenate([faces, faces[:, ::-1]]))
    creases = np.array([[3, 4]]) if creased else None
    assert not refine(mesh, loop(), 1, limit=True, creases=creases).normals.any()
    turned = Mesh(points @ np.linalg.qr(rng.normal(size=(3, 3)))[0], mesh.faces)
    assert not refine(turned, loop(), 1, limit=True, creases=creases).normals.any()


def test_a_fold_takes_no_part_in_the_normal_of_a_vertex_with_other_faces():
    """Two faces there and back, at a vertex of another: the normal there is the other one's."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, -1, 1], [0.9, -1, 2.0]])
    faces = np.array([[0, 1, 2], [0, 3, 4], [4, 3, 0]])
    normals = limit_normals(points, build_topology(faces, len(points))).vertices
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-12)


def test_normals_that_nearly_cancel_have_the_direction_that_is_left():
    normals = np.array([[0.0, 0, 1], [1e-6, 0, -1], [0, 0.6, 0.8], [1e-12, -0.6, -0.8], [0, 0, 0]])
    means = means_of_units(normals, np.array([0, 0, 1, 1, 2]), 4)
    assert means.tolist() == [[1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
