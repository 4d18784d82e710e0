"""Faces that lie on each other: which they are, and what their sides are in the split."""

import numpy as np
import pytest

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.doubled_faces import doubled_faces
from pns_common.connectivity.topology import build_topology
from tests.support.meshes import bow_tie, bumpy_sphere, grid, one_way_pair, three_pages


def sides(faces, creases=()):
    """Doubled and collapsed faces, and as pairs of vertices folds and corners."""
    plain = build_topology(np.array(faces), int(np.max(faces)) + 1)
    topology = with_creases(plain, np.array(creases, dtype=int).reshape(-1, 2))
    lying = doubled_faces(topology)
    folds, corners = (topology.edges[rows].tolist() for rows in (lying.folds, lying.corners))
    return np.flatnonzero(lying.doubled).tolist(), lying.collapsed.tolist(), folds, corners


@pytest.mark.parametrize(
    "mesh", [bow_tie(), bumpy_sphere(0, subdivisions=1), grid(4), one_way_pair(), three_pages()]
)
def test_of_faces_that_do_not_lie_on_each_other_there_is_nothing(mesh):
    assert doubled_faces(build_topology(np.array(mesh[1]), len(mesh[0]))) is None


@pytest.mark.parametrize("copy", [[0, 1, 2], [1, 2, 0], [2, 1, 0]])
def test_a_doubled_faces_sides_are_folds_where_nothing_else_is_on_them(copy):
    # The neighbour's sides 23 and 13 are neither.
    doubled, collapsed, folds, corners = sides([[0, 1, 2], [2, 1, 3], copy])
    assert (doubled, collapsed) == ([0, 2], [])
    alike = copy != [2, 1, 0]  # both the same way round: no side of theirs is interior
    assert folds == ([] if alike else [[0, 1], [0, 2]])
    assert corners == ([[0, 1], [1, 2], [0, 2]] if alike else [[1, 2]])


def test_a_fold_that_is_a_crease_is_a_corner():
    _, _, folds, corners = sides([[0, 1, 2], [2, 1, 0]], creases=[(1, 2)])
    assert (folds, corners) == ([[0, 1], [0, 2]], [[1, 2]])


def test_a_face_with_a_vertex_twice_is_collapsed():
    assert sides([[0, 1, 2], [3, 3, 4], [3, 3, 4]]) == ([], [1, 2], [], [])
