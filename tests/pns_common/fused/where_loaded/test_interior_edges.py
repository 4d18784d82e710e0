"""Interior edges are those of the arrays, whoever finds them."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import interior_edges
from tests.support.meshes import face_lists

FACES = face_lists()


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("name", FACES)
def test_interior_edges_stand_in_the_order_of_a_topology(name, loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(interior_edges, "kernels_loaded", lambda: loaded)
    faces = FACES[name]
    topology = build_topology(np.ascontiguousarray(faces), int(faces.max()) + 1)
    edges, half_edges = interior_edges.interior_edges(faces, topology.vertex_count)
    np.testing.assert_array_equal(edges, topology.edges[topology.interior])
    np.testing.assert_array_equal(half_edges, topology.half_edges[topology.interior])
