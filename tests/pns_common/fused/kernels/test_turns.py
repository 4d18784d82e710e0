"""How far edges turn, as the formulas have it to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.turns import mark_edges_beyond
from pns_common.geometry.crease_lines.turns import edges_beyond
from pns_common.geometry.frames import face_normals
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere, manifolds, soups


def marked(mesh, cosine, way):
    edges = edges_built(mesh)
    beyond = np.ones(len(edges.edges), dtype=bool)
    around = face_normals(mesh.vertices, mesh.faces), edges.half_edges, edges.edge_class
    count = way(mark_edges_beyond)(*around, cosine, 0, len(beyond), beyond)
    assert count == beyond.sum()
    return np.flatnonzero(beyond)


@pytest.mark.parametrize("way", WAYS)
@given(mesh=manifolds() | soups(), cosine=st.floats(-1, 1))
def test_the_marked_edges_are_those_of_the_formula(way, mesh, cosine):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    expected = edges_beyond(normals, topology, topology.interior, cosine)
    np.testing.assert_array_equal(marked(mesh, cosine, WAYS[way]), expected)


@pytest.mark.parametrize("way", WAYS)
def test_an_edge_at_the_angle_itself_is_not_beyond_it(way):
    mesh = Mesh(*bumpy_sphere())
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    n, m = (normals[topology.edge_faces[:, side]] for side in (0, 1))
    cosines = n[:, 0] * m[:, 0] + n[:, 1] * m[:, 1] + n[:, 2] * m[:, 2]
    for cosine in cosines[::7].tolist():
        found = marked(mesh, cosine, WAYS[way])
        assert (cosines[found] < cosine).all()
        assert len(found) == (cosines < cosine).sum()
