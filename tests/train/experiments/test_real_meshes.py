"""The table of real meshes: what stands beside the methods."""

import numpy as np
import pytest

from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.schemes import loop
from train.data.primitives import box, icosphere
from train.experiments.beyond.real_meshes import on_surface
from train.metrics.whole_surface import normal_jump


def test_vertices_on_the_surface_lie_there_and_faces_stay():
    coarse, sphere = icosphere(1), icosphere(5)
    shrunk = refine(coarse, loop(), 1, threads=1).mesh
    laid = on_surface(shrunk, sphere)
    np.testing.assert_array_equal(laid.faces, shrunk.faces)
    radius = np.linalg.norm(laid.vertices, axis=1)
    assert (
        np.abs(radius - 1).max() < 2e-3 < np.abs(np.linalg.norm(shrunk.vertices, axis=1) - 1).max()
    )


def test_the_normal_jump_of_a_cube_is_a_right_angle():
    assert normal_jump(box()) == pytest.approx(np.pi / 2)


def test_the_normal_jump_is_the_reports():
    rng = np.random.default_rng(2)
    rough = icosphere(2)
    rough = Mesh(
        rough.vertices * (1 + 0.1 * rng.normal(size=(len(rough.vertices), 1))), rough.faces
    )
    refined = refine(rough, loop(), 2, threads=1)
    assert normal_jump(refined.mesh) == pytest.approx(
        refined.report["levels"][-1]["normal_jump_max"], abs=1e-12
    )


def test_faces_without_area_do_not_turn():
    flat = Mesh(
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0]]), np.array([[0, 1, 2], [1, 0, 3]])
    )
    assert normal_jump(flat) == 0
