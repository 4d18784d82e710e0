"""Sides of faces are measured with one result wherever it is done, and without a unit of length."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.geometry.side_lengths import BLOCK_FACES, SideLengths, measure_sides
from tests.support.meshes import grid, icosphere, manifolds, soups


def plainly(points, faces):
    sides = points[faces] - points[np.roll(faces, 1, axis=1)]
    return np.sqrt((sides**2).sum(axis=2)).reshape(-1)


@given(manifolds() | soups(), st.floats(1e-30, 1e30))
def test_variation_is_deviation_over_mean_at_any_scale(mesh, scale):
    lengths = plainly(mesh.vertices, mesh.faces)
    measured = measure_sides(scale * mesh.vertices, mesh.faces)
    assert measured.faces == len(mesh.faces)
    assert measured.total == pytest.approx(scale * lengths.sum())
    # The difference of two squares: rounding of one is what is left where sides are even.
    expected = lengths.std() / lengths.mean()
    assert measured.variation == pytest.approx(expected, abs=1e-6, rel=1e-9)


def test_known_meshes():
    assert measure_sides(*icosphere(0)).variation < 1e-7
    points, faces = grid(5)
    # Sides of two lengths, two of one to one that is √2 of them.
    mean = (2 + math.sqrt(2)) / 3
    deviation = math.sqrt(4 / 3 - mean**2)
    assert measure_sides(points, faces).variation == pytest.approx(deviation / mean)


def test_what_has_no_length_is_not_even():
    points = np.ones((3, 3))
    assert measure_sides(points, np.array([[0, 1, 2]])).variation == math.inf
    assert SideLengths().variation == math.inf


@pytest.mark.parametrize("first", [BLOCK_FACES, 2 * BLOCK_FACES])
def test_faces_that_come_by_whole_blocks_have_the_bits_of_all_at_once(first):
    rng = np.random.default_rng(0)
    points = rng.standard_normal((500, 3)).astype(np.float32)
    faces = rng.integers(0, 500, (2 * BLOCK_FACES + 77, 3))
    begun = SideLengths().with_faces(points, faces[:first])
    assert begun.with_faces(points, faces[first:]) == measure_sides(points, faces)
    assert measure_sides(points.astype(np.float64), faces) == measure_sides(points, faces)
