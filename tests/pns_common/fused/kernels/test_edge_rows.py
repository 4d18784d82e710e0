"""Which edges stand alone, as the formulas have it to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.edge_rows import mark_alone
from pns_common.geometry.crease_lines.edge_rows import PARALLEL, ROW_ANGLE, stand_alone
from pns_common.geometry.crease_lines.turns import cosine_of, edges_beyond
from pns_common.geometry.frames import face_normals
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import manifolds, noisy_blocks, prism, soups


def assert_same_are_alone(way, mesh, cosine):
    edges, normals = edges_built(mesh), face_normals(mesh.vertices, mesh.faces)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = edges_beyond(normals, topology, topology.interior, cosine)
    alone, least = np.ones(len(rows), dtype=bool), (PARALLEL**2, cosine_of(ROW_ANGLE))
    around = edges.faces, edges.edges, edges.face_edges, edges.half_edges, edges.edge_class
    rows = rows.astype(np.int32)
    WAYS[way](mark_alone)(mesh.vertices, normals, *around, *least, rows, 0, len(rows), alone)
    np.testing.assert_array_equal(alone, stand_alone(mesh.vertices, normals, topology, rows))
    return alone


@pytest.mark.parametrize("way", WAYS)
@given(mesh=manifolds() | soups() | noisy_blocks(), cosine=st.floats(-1, 1))
def test_edges_stand_alone_where_the_formula_has_them_so(way, mesh, cosine):
    assert_same_are_alone(way, mesh, cosine)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("wide", [1.0, 1.6, 3.0])
@pytest.mark.parametrize("sides", [4, 8, 12])
def test_rows_are_found_in_arcs_that_meet_a_plane(way, sides, wide):
    """Of walls that are as wide, and more and less so, up to sharp edges."""
    angles = np.linspace(0, np.pi, sides + 1)
    mesh = prism(np.stack([wide * np.cos(angles), np.sin(angles)], axis=-1))
    alone = assert_same_are_alone(way, mesh, cosine_of(10.0))
    assert alone.all() == (wide == 3.0)
