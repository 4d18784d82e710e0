"""The limit of a refined mesh from the coarse one's connectivity: that of the mesh itself."""

import numpy as np
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


def test_limits_of_a_sheet_that_is_there_from_both_sides():
    """Its faces are there twice, and each way round: no ring of theirs is a plain mesh's."""
    points, faces = grid(4, bent)
    topology = build_topology(np.concatenate([faces, faces[:5, ::-1]]), len(points))
    refined, after = stepped(points, topology)
    positions = refined_limit_positions(refined, topology)
    np.testing.assert_allclose(positions, limit_positions(refined, after), rtol=0, atol=1e-13)
    normals = refined_limit_normals(refined, topology)
    np.testing.assert_allclose(normals, limit_normals(refined, after).vertices, atol=1e-9)
    tensor = torch.tensor(refined)
    np.testing.assert_allclose(refined_limit_positions(tensor, topology).numpy(), positions)
    blocked = refined_limit_positions(refined, topology, Blocks(2, 5))
    np.testing.assert_array_equal(blocked, positions)
