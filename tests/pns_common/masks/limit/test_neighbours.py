"""Neighbours in a mesh and in its split: the same rings, with edges' vertices in place of ends."""

import numpy as np
from hypothesis import given

from pns_common.connectivity.topology import build_topology, split
from pns_common.masks.limit.neighbours import own_neighbours, split_neighbours
from tests.support.meshes import manifolds, soups


def topology_of(mesh):
    return build_topology(mesh.faces, len(mesh.vertices))


@given(manifolds() | soups())
def test_neighbours_in_the_mesh_are_the_other_corners_and_ends(mesh):
    around = own_neighbours(topology_of(mesh))
    for corner, (vertex, after, before) in enumerate(
        (face[i], face[(i + 1) % 3], face[(i + 2) % 3]) for face in mesh.faces for i in range(3)
    ):
        assert mesh.faces[corner // 3, corner % 3] == vertex
        assert (around.leaving[corner], around.arriving[corner]) == (after, before)
    ends = around.topology.edges
    np.testing.assert_array_equal(around.of_spokes[0::2], ends[:, 1])
    np.testing.assert_array_equal(around.of_spokes[1::2], ends[:, 0])


@given(manifolds() | soups())
def test_neighbours_in_the_split_mesh_are_those_of_the_child_at_the_corner(mesh):
    topology = topology_of(mesh)
    around, children = split_neighbours(topology), split(topology)
    for corner in range(3 * len(mesh.faces)):
        child = children[4 * (corner // 3) + corner % 3].tolist()
        assert child == [
            mesh.faces[corner // 3, corner % 3],
            around.leaving[corner],
            around.arriving[corner],
        ]
    middles = topology.vertex_count + np.arange(len(topology.edges))
    np.testing.assert_array_equal(around.of_spokes.reshape(-1, 2), np.stack([middles] * 2, axis=1))
