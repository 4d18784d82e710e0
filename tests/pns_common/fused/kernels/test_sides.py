"""What lies between two sides, as the formula has it to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.base.arrays import marked
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.sides import mark_between_sides
from pns_common.geometry.crease_lines.sides import between_sides
from pns_common.geometry.crease_lines.turns import edges_beyond
from pns_common.geometry.frames import face_normals
from tests.support.crease_lines import WEDGE
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import manifolds, noisy_blocks, soups


@pytest.mark.parametrize("way", WAYS)
@given(mesh=manifolds() | soups() | noisy_blocks() | st.just(WEDGE), cosine=st.floats(-1, 1))
def test_what_lies_between_sides_is_what_the_formula_says(way, mesh, cosine):
    edges, normals = edges_built(mesh), face_normals(mesh.vertices, mesh.faces)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    sharp = edges_beyond(normals, topology, topology.interior, cosine)
    between = np.ones(len(sharp), dtype=bool)
    turning = normals, edges.face_edges, edges.half_edges, edges.edge_class
    is_sharp = marked(sharp, len(edges.edges))
    rows = 0, len(sharp), between
    WAYS[way](mark_between_sides)(*turning, is_sharp, sharp.astype(np.int32), *rows)
    np.testing.assert_array_equal(between, between_sides(normals, topology, sharp))
