"""Which lines go on, as the formulas have it to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.going_on import drop_loose_ends
from pns_common.geometry.crease_lines.going_on import go_on, may_end
from pns_common.geometry.crease_lines.turns import edges_beyond
from pns_common.geometry.frames import face_normals
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import manifolds, noisy_blocks, soups


@pytest.mark.parametrize("way", WAYS)
@given(
    mesh=manifolds() | soups() | noisy_blocks(),
    cosine=st.floats(-1, 1),
    straight=st.floats(-1, 1),
)
def test_lines_lose_the_ends_that_the_formula_takes(way, mesh, cosine, straight):
    edges, normals = edges_built(mesh), face_normals(mesh.vertices, mesh.faces)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    rows = edges_beyond(normals, topology, topology.interior, cosine)
    left, met = np.ones(len(rows), dtype=bool), np.zeros(edges.vertex_count, dtype=np.int32)
    at_rim = may_end(edges, normals)
    args = mesh.vertices, edges.edges, rows.astype(np.int32), at_rim, straight
    total = np.zeros((edges.vertex_count, 3))
    WAYS[way](drop_loose_ends)(*args, met, total, left)
    np.testing.assert_array_equal(left, go_on(mesh.vertices, topology, rows, at_rim, straight))
    assert not met.any()
    assert not total.any()
