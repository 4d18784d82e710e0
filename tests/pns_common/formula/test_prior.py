"""The prior's pushes: on a regular solid by hand, and 0 where Loop shrinks nothing."""

import numpy as np
import pytest

from pns_common import Creases, Mesh, load_model, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.formula.prior import clear_normals, normal_pushes
from pns_common.geometry.frames import face_normals
from pns_common.geometry.rings import Rings
from tests.support.meshes import grid, icosphere


def pushes(points, faces):
    topology = build_topology(faces, len(points))
    return normal_pushes(Rings(topology, points, face_normals(points, faces)))


def test_an_icosahedrons_vertices_are_pushed_by_what_loop_takes_them_in():
    points, faces = icosphere(0)
    made = pushes(points, faces)
    # The mean of a vertex's five neighbours stands at 1 / √5 of its radius.
    beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / 5) / 4) ** 2) / 5
    weight = 5 / (3 / (8 * beta) + 5)
    np.testing.assert_allclose(made, weight * (1 - 1 / np.sqrt(5)) * points, atol=1e-14)


def test_planes_and_boundaries_are_not_pushed():
    assert not pushes(*grid(5)).any()
    # A tent: all of it but the middle lies on the boundary.
    points, faces = grid(3, lambda x, y: 1 - np.maximum(np.abs(x), np.abs(y)))
    made = pushes(points, faces)
    assert made[4, 2] > 0
    assert not np.delete(made, 4, axis=0).any()


@pytest.mark.parametrize("degrees", [90, 120])
def test_where_a_crease_ends_in_a_fold_no_dent_is_left(degrees):
    """Left to Loop, the vertex there is taken in twice as far as those beside it."""
    points, faces = grid(11)
    half, y = np.radians(degrees) / 2, points[:, 1]
    folded = np.stack([points[:, 0], y * np.cos(half), -np.abs(y) * np.sin(half)], axis=1)
    row = 11 * np.arange(11) + 5
    creases = Creases(np.stack([row[:5], row[1:6]], axis=1), levels=2)
    made = refine(Mesh(folded, faces), pns(load_model()), 3, creases=creases, limit=True)
    below = -made.mesh.vertices[row, 2]
    assert below[5] < max(below[4], below[6])


def test_a_mesh_turned_over_is_pushed_the_same_way():
    points, faces = icosphere(1)
    points = points * [1, 2, 3]
    np.testing.assert_allclose(pushes(points, faces[:, ::-1]), pushes(points, faces), atol=1e-14)


def test_mean_normals_are_scaled_to_1_down_to_a_quarter_and_fade_below():
    mean = np.outer([1.0, 1 / 3, 0.25, 0.125, 0.0], [0.6, 0, 0.8])
    np.testing.assert_allclose(
        np.linalg.norm(clear_normals(mean), axis=1), [1, 1, 1, 0.5, 0], atol=1e-12
    )
