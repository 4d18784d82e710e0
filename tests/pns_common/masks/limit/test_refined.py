"""The limit of a refined mesh from the coarse one's connectivity: that of the mesh itself."""

import tracemalloc

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit import (
    limit_normals,
    limit_positions,
    refined_limit_normals,
    refined_limit_positions,
)
from tests.support.meshes import bent, grid, manifolds, soups
from tests.support.stars import creased, stepped


@given(manifolds(), st.integers(0, 2**31))
def test_limits_of_a_refined_mesh_need_no_connectivity_of_it(mesh, seed):
    topology = creased(mesh.vertices, mesh.faces, seed)
    refined, after = stepped(mesh.vertices, topology)
    positions = refined_limit_positions(refined, topology)
    np.testing.assert_allclose(positions, limit_positions(refined, after), rtol=0, atol=1e-13)
    normals = refined_limit_normals(refined, topology)
    expected = limit_normals(refined, after).vertices
    np.testing.assert_allclose(normals, expected, rtol=0, atol=1e-9)
    blocked = refined_limit_positions(refined, topology, Blocks(2, 5))
    np.testing.assert_array_equal(blocked, positions)
    tensor = torch.tensor(refined)
    np.testing.assert_allclose(refined_limit_normals(tensor, topology).numpy(), normals, atol=1e-9)


@given(soups(), st.integers(0, 2**31))
def test_so_do_limits_of_a_refined_soup(mesh, seed):
    """Where faces lie on each other too, whose sides' middles are not regular."""
    points = mesh.vertices / np.abs(mesh.vertices).max()
    topology = creased(points, mesh.faces, seed)
    refined, after = stepped(points, topology)
    positions = refined_limit_positions(refined, topology)
    np.testing.assert_allclose(positions, limit_positions(refined, after), rtol=0, atol=1e-12)


@pytest.mark.parametrize("twice", [5, 18])
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_limits_of_a_sheet_that_is_there_from_both_sides(twice, seed):
    """Its faces are there twice, and each way round: no ring of theirs is a plain mesh's."""
    points, faces = grid(4, bent)
    faces = np.concatenate([faces, faces[:twice, ::-1], faces[3:4]])
    topology = build_topology(faces, len(points))
    topology = topology if seed is None else creased(points, faces, seed)
    refined, after = stepped(points, topology)
    positions = refined_limit_positions(refined, topology)
    np.testing.assert_allclose(positions, limit_positions(refined, after), rtol=0, atol=1e-13)
    normals = refined_limit_normals(refined, topology)
    np.testing.assert_allclose(normals, limit_normals(refined, after).vertices, atol=1e-9)
    tensor = torch.tensor(refined)
    np.testing.assert_allclose(refined_limit_positions(tensor, topology).numpy(), positions)
    np.testing.assert_allclose(refined_limit_normals(tensor, topology).numpy(), normals, atol=1e-9)
    for limits, whole in ((refined_limit_positions, positions), (refined_limit_normals, normals)):
        np.testing.assert_array_equal(limits(refined, topology, Blocks(2, 5)), whole)


def test_limits_of_a_doubled_sheet_take_at_most_twice_the_memory_of_a_plain_ones():
    """As many faces in both: the split, four times as large, is built for neither."""
    (points, once), (wide, plain) = grid(50, bent), grid(70, bent)
    peaks = []
    for vertices, faces in ((wide, plain), (points, np.concatenate([once, once[:, ::-1]]))):
        topology = build_topology(faces, len(vertices))
        refined = np.zeros((len(vertices) + len(topology.edges), 3))
        tracemalloc.start()
        refined_limit_positions(refined, topology, Blocks(1, 1000))
        refined_limit_normals(refined, topology, Blocks(1, 1000))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2 * peaks[0]
