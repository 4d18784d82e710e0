"""Both renderers draw the same view; the one without an extra is always there."""

import importlib.util

import numpy as np
import pytest

from pns_common import Mesh
from tests.support.meshes import bent, grid
from train.experiments.harness.render import HEIGHT, WIDTH, Camera, by_matplotlib, by_pyvista

CAMERA = Camera(azimuth=-62.0, elevation=42.0)


def test_the_camera_is_a_rotation_that_looks_from_its_azimuth():
    axes = CAMERA.axes()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(Camera(0, 0).axes()[2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(Camera(0, 90).axes()[2], [0, 0, 1], atol=1e-15)


def picture(renderer):
    vertices, faces = grid(12, bent)
    return renderer(Mesh(vertices, faces), np.abs(vertices[:, 2]), 0.5, CAMERA)


def test_the_mesh_fills_the_middle_and_leaves_the_corners_white():
    image = picture(by_matplotlib)
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert image.dtype == np.uint8
    assert (image[0, 0] == 255).all()
    assert (image[HEIGHT // 2, WIDTH // 2] < 255).any()
    assert 0.3 < (image < 250).any(axis=-1).mean() < 0.9


@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="needs the extra render")
def test_pyvista_sees_the_same_outline():
    ours, theirs = (
        (picture(renderer) < 250).any(axis=-1) for renderer in (by_matplotlib, by_pyvista)
    )
    assert (ours != theirs).mean() < 0.03
