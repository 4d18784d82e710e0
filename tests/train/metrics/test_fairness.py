"""Bending and volume, against what is known of spheres, tori and boxes."""

import numpy as np
import pytest

from pns_common.mesh import Mesh
from train.data.primitives import box, globe, icosphere, torus
from train.metrics.fairness import bending, volume


def test_a_sphere_bends_by_eight_pi_at_any_size():
    sphere = icosphere(4)
    for size in (1e-3, 1.0, 1e4):
        assert bending(Mesh(size * sphere.vertices, sphere.faces)) == pytest.approx(
            8 * np.pi, rel=0.01
        )


def test_a_torus_bends_as_its_integral_says():
    # κ₁ = 1 / r, κ₂ = cos v / (R + r cos v), dA = r (R + r cos v) du dv, R = 1, r = 0.4.
    v = (np.arange(20_000) + 0.5) / 20_000 * 2 * np.pi
    girth = 1 + 0.4 * np.cos(v)
    expected = 2 * np.pi * 0.4 * ((1 / 0.16 + (np.cos(v) / girth) ** 2) * girth).mean() * 2 * np.pi
    assert bending(torus(120, 60)) == pytest.approx(expected, rel=0.02)


def test_ripples_bend_more():
    smooth = torus(48, 24)
    angle = np.arctan2(smooth.vertices[:, 1], smooth.vertices[:, 0])
    rippled = Mesh(smooth.vertices * (1 + 0.04 * np.cos(12 * angle))[:, None], smooth.faces)
    assert bending(rippled) > 1.2 * bending(smooth)


def test_given_normals_are_used_and_faces_without_area_left_out():
    sphere = icosphere(3)
    still = np.tile([0.0, 0, 1], (len(sphere.vertices), 1))
    assert bending(sphere, still) == 0
    flat = Mesh(
        np.concatenate([sphere.vertices, [[5.0, 0, 0], [6, 0, 0], [7, 0, 0]]]),
        np.concatenate([sphere.faces, [[len(sphere.vertices) + k for k in range(3)]]]),
    )
    assert bending(flat) == pytest.approx(bending(sphere))


def test_volume_of_boxes_and_balls():
    assert volume(box(2, 3, 4)) == pytest.approx(24)
    assert volume(globe(64, 40)) == pytest.approx(4 / 3 * np.pi, rel=0.01)
    turned = box(2, 3, 4)
    assert volume(Mesh(turned.vertices, turned.faces[:, ::-1])) == pytest.approx(-24)
