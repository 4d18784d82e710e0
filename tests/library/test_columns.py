"""Columns go where vertices go, and the subdivision matrix says from where."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, MeshError, ParameterError, loop, refine
from pns_common.columns import (
    ColumnRefinement,
    level_topologies,
    refine_columns,
    subdivision_matrix,
)
from pns_common.limit import limit_positions
from pns_common.parallel import Blocks
from pns_common.topology import build_topology
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, soups


def applied(matrix, columns):
    made = np.zeros((matrix.shape[0], columns.shape[1]))
    np.add.at(made, matrix.rows, matrix.weights[:, None] * columns[matrix.columns])
    return made


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


@given(st.one_of(manifolds(), soups()), st.integers(0, 2**31), st.integers(1, 2))
def test_the_matrix_times_columns_are_the_refined_columns(mesh, seed, levels):
    rng = np.random.default_rng(seed)
    topologies = level_topologies(mesh.faces, len(mesh.vertices), levels)
    topologies[0] = topologies[0].with_sharpness(rng.choice([0, 0.4, 1], len(topologies[0].edges)))
    matrix, columns = subdivision_matrix(topologies), rng.standard_normal((len(mesh.vertices), 4))
    made = refine_columns(columns, topologies)
    assert matrix.shape == (len(made), len(columns))
    np.testing.assert_allclose(applied(matrix, columns), made, atol=1e-14)
    # Convex, sorted, and nothing twice.
    assert matrix.weights.min() > 0
    np.testing.assert_allclose(np.bincount(matrix.rows, matrix.weights), 1, atol=1e-14)
    assert (np.diff(matrix.rows * matrix.shape[1] + matrix.columns) > 0).all()


def test_the_matrix_of_one_level_holds_loops_masks():
    matrix = subdivision_matrix(level_topologies(np.array([[0, 1, 2], [2, 1, 3]]), 4, 1))
    rows = [matrix.rows == row for row in range(9)]
    # An interior edge between 1 and 2; the vertex of valence 2 at 0, on the boundary.
    assert matrix.columns[rows[5]].tolist() == [0, 1, 2, 3]
    assert matrix.weights[rows[5]].tolist() == [1 / 8, 3 / 8, 3 / 8, 1 / 8]
    assert matrix.columns[rows[0]].tolist() == [0, 1, 2]
    assert matrix.weights[rows[0]].tolist() == [3 / 4, 1 / 8, 1 / 8]


def test_vertices_without_faces_stay():
    points, faces = bumpy_sphere()
    topologies = level_topologies(faces, len(points) + 1, 1)
    columns = np.vstack([points, [[9.0, 9, 9]]])
    assert refine_columns(columns, topologies)[len(points)].tolist() == [9, 9, 9]
    matrix = subdivision_matrix(topologies)
    assert matrix.columns[matrix.rows == len(points)].tolist() == [len(points)]


def test_one_map_serves_many_columns():
    points, faces = bumpy_sphere()
    topologies = level_topologies(faces, len(points), 2)
    linear = ColumnRefinement(topologies, limit=True)
    assert linear.count == len(linear(points)) == linear.last.vertex_count
    refined = refine_columns(points, topologies)
    np.testing.assert_array_equal(linear(points), limit_positions(refined, linear.last))
    halves = [linear(points[:, :1]), linear(points[:, 1:])]
    np.testing.assert_array_equal(np.hstack(halves), linear(points))
    assert linear(np.zeros((len(points), 0))).shape == (linear.count, 0)


def test_whole_numbers_are_refined_as_floats():
    topologies = level_topologies(np.array([[0, 1, 2]]), 3, 1)
    made = refine_columns(np.array([[1], [2], [4]]), topologies)
    np.testing.assert_array_equal(made[3:, 0], [1.5, 3, 2.5])


def test_topologies_are_those_of_the_refined_faces():
    faces = np.random.default_rng(0).integers(0, 9, (20, 3))
    first, second = level_topologies(faces, 9, 2)
    made = refine(Mesh(np.random.default_rng(0).standard_normal((9, 3)), faces), loop(), 1)
    np.testing.assert_array_equal(second.faces, made.mesh.faces)
    np.testing.assert_array_equal(first.edges, build_topology(faces, 9).edges)
    assert level_topologies(faces, 9, 0) == []


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
