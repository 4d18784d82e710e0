"""Edges are numbered as the array kernels number them, whoever does it."""

import numpy as np
import pytest

from pns_common.connectivity.topology import build_topology
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import face_edges
from tests.support.meshes import face_lists

FACES = face_lists()


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("name", FACES)
def test_edges_have_the_numbers_of_the_topology(name, loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(face_edges, "kernels_loaded", lambda: loaded)
    faces = FACES[name]
    topology = build_topology(faces, int(faces.max()) + 1)
    numbered = face_edges.number_edges(faces, int(faces.max()) + 1)
    for made, expected in zip(numbered, (topology.edges, topology.face_edges), strict=True):
        assert made.dtype == expected.dtype
        np.testing.assert_array_equal(made, expected)
