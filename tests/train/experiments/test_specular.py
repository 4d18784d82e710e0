"""Pictures with highlights: the silhouette is right, nothing is left empty, ripples change it."""

import numpy as np
import pytest

from pns_common.mesh import Mesh
from train.data.primitives import icosphere
from train.experiments.harness.specular import MARGIN, SIDE, camera, shaded

BOX = np.array([[-1.0, -1, -1], [1, 1, 1]])
SPHERE = icosphere(4)


def drawn(mesh, azimuth=20):
    return shaded(mesh, camera(azimuth, 30), BOX)


def test_a_ball_covers_its_disc_and_nothing_else():
    picture = drawn(SPHERE)
    radius = SIDE / (MARGIN * np.sqrt(12))
    row, column = np.mgrid[:SIDE, :SIDE]
    away = np.hypot(row - SIDE / 2 + 0.5, column - SIDE / 2 + 0.5)
    covered = (picture < 1).any(axis=2)
    assert covered[away < radius - 2].all()
    assert not covered[away > radius + 2].any()


def test_a_ball_looks_the_same_from_all_sides_and_has_highlights():
    front, side = drawn(SPHERE), drawn(SPHERE, azimuth=77)
    assert np.abs(front - side).mean() < 0.01
    assert (front[SIDE // 2 - 60 : SIDE // 2 + 60].min(axis=2) > 0.95).any()


def test_ripples_show():
    angle = np.arctan2(SPHERE.vertices[:, 1], SPHERE.vertices[:, 0])
    rippled = Mesh(SPHERE.vertices * (1 + 0.01 * np.sin(16 * angle))[:, None], SPHERE.faces)
    assert np.abs(drawn(rippled) - drawn(SPHERE)).mean() >= 0.004


@pytest.mark.parametrize("up", [1, 2])
def test_cameras_are_rotations_that_look_level_with_their_axis_upright(up):
    view = camera(40, 0, up)
    np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view) == pytest.approx(1)
    np.testing.assert_allclose(view[1], np.eye(3)[up], atol=1e-12)
