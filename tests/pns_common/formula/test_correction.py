"""The gate and the ball: where nothing is added, and how much at most."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common import ModelError
from pns_common.connectivity.topology import build_topology
from pns_common.formula.correction import checked_answer, curvature_gate, project_to_ball
from pns_common.geometry.frames import edge_frames, edge_stencil, face_normals
from tests.support.meshes import grid

ROUNDING = 1 + 1e-12


def test_gate_and_its_slope_vanish_at_coplanar_faces():
    vertices, faces = grid(2)

    def gamma(lift):
        points = vertices.copy()
        points[0, 2] = lift
        topology = build_topology(faces, 4)
        stencil = edge_stencil(
            points,
            face_normals(points, faces),
            topology.stencil[topology.interior],
            topology.edge_faces[topology.interior],
        )
        return curvature_gate(10.0)(edge_frames(stencil).curvature)[0]

    assert gamma(0.0) == 0
    # x ~ lift², γ ~ x² ~ lift⁴: halving the lift divides the gate by 16.
    assert gamma(0.02) / gamma(0.01) == pytest.approx(16, rel=1e-2)
    assert 0 < gamma(0.01) < 1e-6


@given(st.lists(st.floats(-1e300, 1e300) | st.floats(-1, 1), min_size=3, max_size=3))
def test_projection_never_leaves_the_ball_and_keeps_what_is_inside(vector):
    (projected,) = project_to_ball(np.array([vector]))
    assert math.hypot(*projected) <= ROUNDING
    if math.hypot(*vector) < 1 - 1e-12:
        np.testing.assert_array_equal(projected, vector)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (np.zeros((4, 2)), r"\(4, 2\)"),
        (np.full((4, 3), np.nan), "NaN"),
        (np.zeros(12), r"\(12,\)"),
        (None, "object"),
        (np.zeros((4, 3), complex), "complex128"),
    ],
)
def test_answers_of_another_shape_or_that_are_no_numbers_are_an_error(answer, says):
    with pytest.raises(ModelError, match=says):
        checked_answer(answer, np.zeros((4, 3)))


def test_answers_may_be_tensors_or_lists_beside_arrays():
    for answer in (torch.ones((4, 3), requires_grad=True), [[1, 1, 1]] * 4):
        checked = checked_answer(answer, np.zeros((4, 3)))
        assert checked.dtype == np.float64
        np.testing.assert_array_equal(checked, np.ones((4, 3)))
