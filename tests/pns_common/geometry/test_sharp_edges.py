"""Interior edges whose faces turn by more than an angle."""

import numpy as np
import pytest

from pns_common.geometry.sharp_edges import edges_sharper_than
from train.data.primitives import box, cylinder


@pytest.mark.parametrize(("degrees", "count"), [(44.9, 8 + 16), (45.1, 16), (89.9, 16), (90.1, 0)])
def test_a_cylinders_rims_turn_by_ninety_degrees_and_its_walls_by_a_side(degrees, count):
    mesh = cylinder(8)
    assert len(edges_sharper_than(mesh.vertices, mesh.faces, np.radians(degrees))) == count


def test_the_smallest_turn_counts_and_none_that_is_not_there():
    fold = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 1e-9]])
    faces = np.array([[0, 1, 2], [1, 0, 3]])
    assert edges_sharper_than(fold, faces, 0.0).tolist() == [[0, 1]]
    assert len(edges_sharper_than(fold * [1, 1, 0], faces, 0.0)) == 0


def test_boundaries_and_faces_without_area_have_no_sharp_edge():
    mesh = box()
    assert len(edges_sharper_than(mesh.vertices, mesh.faces[:1], 0.1)) == 0
    flattened = mesh.vertices.copy()
    flattened[mesh.faces[0]] = flattened[mesh.faces[0, 0]]
    ends = edges_sharper_than(flattened, mesh.faces[:2], 0.1)
    assert len(ends) == 0


def test_no_two_faces_turn_by_more_than_half_a_turn():
    mesh = box()
    assert len(edges_sharper_than(mesh.vertices, mesh.faces, 4.0)) == 0
