"""What may lie beside a plane side: all that does, and little else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.fused.kernels.plane_sides import mark_beside_level_faces
from pns_common.geometry.crease_lines.plane_sides import beside_planes
from pns_common.geometry.crease_lines.turns import (
    IN_ONE_PLANE,
    cosine_of,
    edges_beyond,
    turn_cosines,
)
from pns_common.geometry.frames import face_normals
from tests.support.crease_lines import pleat, tube
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import manifolds, noisy_blocks, soups

MESHES = manifolds() | soups() | noisy_blocks() | st.sampled_from([pleat(30), tube(8, across=3)])


def marked_by_kernel(mesh, cosine, way):
    """Return edges beyond a degree, and which of them are marked."""
    edges, normals = edges_built(mesh), face_normals(mesh.vertices, mesh.faces)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = edges_beyond(normals, topology, topology.interior, cosine_of(1.0))
    marks = np.ones(len(rows), dtype=bool)
    turning = normals, edges.face_edges, edges.half_edges, edges.edge_class
    asked = rows.astype(np.int32), 0, len(rows), marks
    WAYS[way](mark_beside_level_faces)(*turning, cosine, *asked)
    return normals, topology, rows, marks


@pytest.mark.parametrize("way", WAYS)
@given(mesh=MESHES, cosine=st.floats(-1, 1))
def test_an_edge_is_marked_where_both_other_sides_of_a_face_turn_by_less(way, mesh, cosine):
    normals, topology, rows, marks = marked_by_kernel(mesh, cosine, way)
    sides = topology.face_edges[topology.half_edges[rows] // 3]
    level = topology.edge_class[sides] == EdgeClass.INTERIOR
    level &= turn_cosines(normals, topology, sides) > cosine
    level |= sides == rows[:, None, None]
    np.testing.assert_array_equal(marks, level.all(axis=2).any(axis=1))


@pytest.mark.parametrize("way", WAYS)
@given(mesh=MESHES)
def test_all_that_lies_beside_a_plane_side_is_marked(way, mesh):
    normals, topology, rows, marks = marked_by_kernel(mesh, cosine_of(IN_ONE_PLANE), way)
    assert not (beside_planes(normals, topology, rows) & ~marks).any()
