"""Edges by chains, by arithmetic from the parent's, and by a sort: always the same."""

import numpy as np
import pytest
from hypothesis import given

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import EdgeClass, build_topology, split
from pns_common.fused.levels.mesh_edges import (
    _sorted_edges,
    split_mesh_edges,
    split_mesh_faces,
)
from tests.support.kernels import assert_kernels_agree, edges_built
from tests.support.meshes import bumpy_sphere, grid, manifolds, soups


@given(soups() | manifolds())
def test_chains_and_a_sort_find_the_same(mesh):
    by_sort = _sorted_edges(mesh.faces.astype(np.int32), len(mesh.vertices))
    by_chains = edges_built(mesh)
    for name in ("vertex_count", "faces", "edges", "face_edges", "edge_class", "plain"):
        assert np.array_equal(getattr(by_chains, name), getattr(by_sort, name)), name
    np.testing.assert_array_equal(by_chains.half_edges[:, 0], by_sort.half_edges[:, 0])
    # What two half-edges of an irregular edge are, nobody reads.
    read = by_chains.edge_class != EdgeClass.IRREGULAR
    np.testing.assert_array_equal(by_chains.half_edges[read], by_sort.half_edges[read])


@given(soups() | manifolds())
def test_a_split_mesh_has_the_edges_that_are_found_in_it(mesh):
    parent = edges_built(mesh)
    children = split(build_topology(mesh.faces, len(mesh.vertices)))
    again = Mesh(np.zeros((children.max() + 1, 3)), children)
    made = split_mesh_edges(parent, Blocks(2, rows=5))
    found = edges_built(again)
    assert made.vertex_count == len(mesh.vertices) + len(parent.edges)
    for name in ("faces", "edges", "face_edges", "half_edges", "edge_class"):
        assert np.array_equal(getattr(made, name), getattr(found, name)), name
    for dtype in (np.int32, np.int64):
        faces = split_mesh_faces(parent, dtype, Blocks(1))
        assert faces.dtype == dtype
        np.testing.assert_array_equal(faces, children)


def test_sharp_edges_are_counted_at_their_ends():
    mesh = edges_built(Mesh(*grid(3)))
    assert (len(mesh.sharp_edges), len(mesh.interior)) == (8, 8)
    assert mesh.sharp.tolist() == [2, 2, 2, 2, 0, 2, 2, 2, 2]
    closed = edges_built(Mesh(*bumpy_sphere(0)))
    assert len(closed.sharp) == 0


def test_kernels_agree_where_all_corners_meet_in_one_hub():
    # The hub is the lower end of all its edges: chains would take k² / 2 steps.
    count = 400
    rim = np.stack([np.cos(np.arange(count)), np.sin(np.arange(count)), np.zeros(count)], axis=1)
    around = np.arange(1, count + 1)
    faces = np.stack([np.zeros(count, int), around, np.roll(around, -1)], axis=1)
    assert_kernels_agree(Mesh(np.vstack([[[0, 0, 1.0]], rim]), faces), levels=2)


@pytest.mark.parametrize("repeat", [[0, 1, 2], [1, 0, 2], [2, 0, 1]])
def test_kernels_agree_where_a_face_is_repeated_late(repeat):
    # Every edge of the repeated face is known by then, some of them more than twice.
    vertices, faces = bumpy_sphere(1, subdivisions=0)
    again = np.vstack([faces, faces[:1, repeat]])
    assert_kernels_agree(Mesh(vertices, again), levels=3)
    twice = np.vstack([faces, faces[3:8, repeat], faces[:6]])
    assert_kernels_agree(Mesh(vertices, twice), levels=2)
