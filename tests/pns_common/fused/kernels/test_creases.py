"""Which edges are of crease lines, mark by mark, as the formulas have it to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh
from pns_common.connectivity.topology import build_topology
from pns_common.fused.kernels.creases import (
    drop_loose_ends,
    mark_edges_beyond,
    mark_flat_sides,
)
from pns_common.geometry.crease_lines import edges_beyond, go_on, have_flat_sides, may_end
from pns_common.geometry.frames import face_normals
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import block, bumpy_sphere, manifolds, soups


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


NOISY = [Mesh(*block(3, noise=0.2 * k, closed=k % 2 == 0)) for k in range(4)]


@pytest.mark.parametrize("way", WAYS)
@given(mesh=manifolds() | soups() | st.sampled_from(NOISY), cosine=st.floats(-1, 1))
def test_sides_are_flat_where_the_formula_has_them_so(way, mesh, cosine):
    edges, normals = edges_built(mesh), face_normals(mesh.vertices, mesh.faces)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    sharp = edges_beyond(normals, topology, topology.interior, cosine)
    flat = np.ones(len(sharp), dtype=bool)
    around = normals, edges.face_edges, edges.half_edges, edges.edge_class, sharp.astype(np.int32)
    WAYS[way](mark_flat_sides)(*around, 0, len(sharp), flat)
    np.testing.assert_array_equal(flat, have_flat_sides(normals, topology, sharp))


@pytest.mark.parametrize("way", WAYS)
@given(
    mesh=manifolds() | soups() | st.sampled_from(NOISY),
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
