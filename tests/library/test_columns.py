"""Columns go where vertices go, and the subdivision matrix says from where."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, MeshError, ParameterError, load_model, loop, pns
from pns_common.carry.columns import (
    level_topologies,
    refine_columns,
)
from pns_common.operator.scheme import catmull_clark
from pns_common.parallel import Blocks
from pns_common.schemes import LOOP
from pns_common.schemes.matrix import subdivision_matrix
from tests.support.control_points import refine
from tests.support.meshes import bent, grid, manifolds, soups


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("sharp_levels", [None, 1])
def test_positions_as_columns_are_refined_as_positions(limit, sharp_levels):
    points, faces = grid(6, bent)
    creases = Creases(np.array([[7, 8], [8, 14], [14, 15]]), levels=sharp_levels)
    made = refine(Mesh(points, faces), loop(), 3, creases=creases, limit=limit)
    topologies = level_topologies(faces, len(points), 3, creases)
    columns = np.hstack([points, points[:, :1]])
    expected = np.hstack([made.mesh.vertices, made.mesh.vertices[:, :1]])
    refined = refine_columns(columns, topologies, limit=limit)
    np.testing.assert_array_equal(refined, expected)
    again = refine_columns(columns, made.topologies, limit=limit, blocks=Blocks(2, rows=9))
    np.testing.assert_array_equal(again, refined)


@given(st.one_of(manifolds(), soups()), st.integers(1, 3))
def test_the_matrix_times_vertices_are_loops_vertices(mesh, levels):
    matrix = loop().matrix(mesh, levels)
    assert (matrix.data > 0).all()
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-15)
    made = refine(mesh, loop(), levels).mesh.vertices
    assert np.abs(matrix @ mesh.vertices - made).max() <= 1e-15 * (1 + np.abs(mesh.vertices).max())


def test_the_matrix_of_polygons_gives_catmull_clarks_vertices():
    mesh = Mesh(np.random.default_rng(0).standard_normal((8, 3)), [[0, 1, 3, 2], [1, 4, 5, 6, 3]])
    made = refine(mesh, catmull_clark(), 2).mesh.vertices
    given = catmull_clark().matrix(mesh, 2) @ mesh.vertices
    np.testing.assert_allclose(given, made, rtol=0, atol=2e-15)
    with pytest.raises(MeshError, match="expected triangles"):
        loop().matrix(mesh)


def test_creases_are_those_that_refine_keeps():
    mesh = Mesh(*grid(6, bent))
    for creases in (Creases(np.array([[7, 8], [8, 14]]), levels=1), Creases(angle=20), None):
        for scheme in (loop(), pns(load_model(), budget=0)):
            made = refine(mesh, scheme, 2, creases=creases).mesh.vertices
            given = scheme.matrix(mesh, 2, creases) @ mesh.vertices
            np.testing.assert_allclose(given, made, rtol=0, atol=1e-15)


@given(st.one_of(manifolds(), soups()), st.integers(0, 2**31), st.integers(1, 2))
def test_half_sharp_edges_are_in_it(mesh, seed, levels):
    rng = np.random.default_rng(seed)
    topologies = level_topologies(mesh.faces, len(mesh.vertices), levels)
    topologies[0] = topologies[0].with_sharpness(rng.choice([0, 0.4, 1], len(topologies[0].edges)))
    matrix, columns = subdivision_matrix(topologies, LOOP), rng.standard_normal(len(mesh.vertices))
    assert (np.diff(matrix.rows * matrix.shape[1] + matrix.columns) > 0).all()
    products = np.bincount(matrix.rows, matrix.weights * columns[matrix.columns])
    made = refine_columns(columns[:, None], topologies)[:, 0]
    np.testing.assert_allclose(products, made, atol=1e-14)


def test_the_matrix_of_one_level_holds_loops_masks():
    matrix = loop().matrix(Mesh(np.eye(4, 3), [[0, 1, 2], [2, 1, 3]])).toarray()
    # An interior edge between 1 and 2; the vertex of valence 2 at 0, on the boundary.
    assert matrix[5].tolist() == [1 / 8, 3 / 8, 3 / 8, 1 / 8]
    assert matrix[0].tolist() == [3 / 4, 1 / 8, 1 / 8, 0]


@pytest.mark.parametrize("rows", [2, 4])
def test_there_must_be_a_row_for_each_vertex(rows):
    topologies = level_topologies(np.array([[0, 1, 2]]), 3, 1)
    with pytest.raises(ParameterError, match=r"columns.shape"):
        refine_columns(np.zeros((rows, 2)), topologies)
    # Where annotations are enforced, another shape ends there first.
    with pytest.raises((ParameterError, TypeError), match="columns"):
        refine_columns(np.zeros(3), topologies)


def test_bad_faces_and_creases_are_refused():
    with pytest.raises(MeshError, match="indices"):
        level_topologies(np.array([[0, 1, 3]]), 3, 1)
    with pytest.raises(ParameterError, match=r"creases\[0\]"):
        level_topologies(np.array([[0, 1, 2]]), 4, 1, Creases(np.array([[0, 3]])))
