"""Faces that lie on each other: which vertices of their split are irregular."""

import numpy as np
import pytest

from pns_common.connectivity.doubled_faces import irregular_in_split
from pns_common.connectivity.topology import build_topology
from tests.support.meshes import bow_tie, bumpy_sphere, grid, one_way_pair, three_pages


def irregular(faces):
    topology = build_topology(np.array(faces), int(np.max(faces)) + 1)
    return irregular_in_split(topology).tolist()


@pytest.mark.parametrize(
    "mesh", [bow_tie(), bumpy_sphere(0, subdivisions=1), grid(4), one_way_pair(), three_pages()]
)
def test_faces_that_do_not_lie_on_each_other_have_none(mesh):
    assert irregular(mesh[1]) == []


@pytest.mark.parametrize("copy", [[0, 1, 2], [1, 2, 0], [2, 1, 0]])
def test_the_middles_of_a_doubled_faces_sides(copy):
    # Edges 01, 12, 02 are vertices 4, 5 and 6; the neighbour's 23 and 13 are not irregular.
    assert irregular([[0, 1, 2], [2, 1, 3], copy]) == [4, 5, 6]


def test_all_vertices_of_a_face_with_a_vertex_twice():
    assert irregular([[0, 1, 2], [3, 3, 4]]) == [3, 4, 8, 9]
