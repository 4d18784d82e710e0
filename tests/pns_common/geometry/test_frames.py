"""Frames of edges: a rotation for every input, by hand on a fold, and where it is the fallback."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, pns, refine
from pns_common.geometry.frames import EdgeStencil, edge_frames, rotate, shut_where_degenerate
from tests.support.networks import random_model

MODEL = random_model(0)


# Two faces on the edge from (0, 0, 0) to (0, 2, 0), at right angles to each other: a crest.
CREST = EdgeStencil(
    a=np.array([[0.0, 0, 0]]),
    b=np.array([[0.0, 2, 0]]),
    c=np.array([[-1.0, 1, 0]]),
    d=np.array([[0.0, 1, -1]]),
    n1=np.array([[0.0, 0, 1]]),
    n2=np.array([[1.0, 0, 0]]),
)


def test_the_frame_of_a_right_angle_is_known():
    frames, half = edge_frames(CREST), np.sqrt(0.5)
    assert (frames.length[0], frames.curvature[0], frames.degenerate[0]) == (2, 1, False)
    np.testing.assert_allclose(frames.tangent, [[0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(frames.normal, [[half, 0, half]], atol=1e-15)
    np.testing.assert_allclose(frames.binormal, [[half, 0, -half]], atol=1e-15)
    outwards = rotate(frames, np.array([[0.0, 3.0, 0.0]]))
    np.testing.assert_allclose(outwards, [[3 * half, 0, 3 * half]], atol=1e-15)


def test_antiparallel_faces_have_the_worlds_axes_and_only_one_reading_has_curvature():
    folded = replace(CREST, n2=-CREST.n1)
    frames, shut = edge_frames(folded), shut_where_degenerate(folded)
    axes = np.stack([frames.tangent, frames.normal, frames.binormal], axis=1)[0]
    np.testing.assert_array_equal(axes, np.eye(3))
    assert frames.degenerate[0]
    assert (frames.curvature[0], shut.curvature[0]) == (2, 0)


def degenerate_frames(points, faces=((0, 1, 2), (1, 0, 3))):
    return refine(Mesh(np.array(points, dtype=float), np.array(faces)), pns(MODEL)).report[
        "levels"
    ][0]["degenerate_frames"]


@pytest.mark.parametrize(("height", "degenerate"), [(1e-13, 1), (1e-11, 0)])
def test_a_face_has_no_area_where_rounding_would_make_its_normal(height, degenerate):
    points = [[0, 0, 0], [1, 0, 0], [0.5, height, 0], [0.5, -1, 0]]
    assert degenerate_frames(points) == degenerate


@pytest.mark.parametrize(("angle", "degenerate"), [(1e-4, 1), (1e-2, 0)])
def test_faces_folded_onto_each_other_are_antiparallel_within_the_papers_epsilon(angle, degenerate):
    """1 + n1 · n2 = 1 − cos(angle): 5e-9 within ε = 1e-6, 5e-5 outside."""
    lifted = [0.5, np.cos(angle), np.sin(angle)]
    points = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], lifted]
    assert degenerate_frames(points) == degenerate
