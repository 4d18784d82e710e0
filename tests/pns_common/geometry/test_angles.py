"""Angles against the arctangent of C, and where there is nothing to measure."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.geometry.angles import angle_between

SIZES = st.floats(1e-150, 1e150)


@given(SIZES, SIZES, st.booleans())
def test_angles_are_those_of_the_arctangent(across, along, blunt):
    along = -along if blunt else along
    made = angle_between(np.array(across), np.array(along))
    assert float(made) == pytest.approx(math.atan2(across, along), rel=2.0**-51, abs=0)


def test_no_angle_jumps_where_the_formula_changes():
    angles = np.linspace(0, np.pi, 200_001)
    made = angle_between(np.abs(np.sin(angles)), np.cos(angles))
    np.testing.assert_allclose(made, angles, rtol=1e-15, atol=1e-15)


def test_nothing_across_is_no_angle_or_half_a_turn():
    across, along = np.array([0.0, 0, 0, 0, 1]), np.array([2.0, -2, 0, -0.0, 0])
    np.testing.assert_array_equal(angle_between(across, along), [0, math.pi, 0, 0, math.pi / 2])


def test_the_unit_does_not_matter():
    across, along = np.random.default_rng(0).standard_normal((2, 1000))
    across = np.abs(across)
    made = [angle_between(unit * across, unit * along) for unit in (1.0, 2.0**-300, 2.0**300)]
    assert len({angles.tobytes() for angles in made}) == 1
