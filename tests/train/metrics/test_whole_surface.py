"""The largest turn between neighbouring faces: of a cube, as reports have it, without specks."""

import numpy as np
import pytest
from pns_common.refine import refine

from pns_common.mesh import Mesh
from pns_common.schemes import loop
from train.data.primitives import box, icosphere
from train.metrics.whole_surface import normal_jump


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
