"""Loop's masks over columns: the stencil that moves the vertices, and nothing beside it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, MeshError, ParameterError, loop, refine
from pns_common.connectivity.creases import Creases
from pns_common.masks.linear import level_topologies, refine_linear
from tests.support.meshes import bumpy_sphere, manifolds, soups

MESHES = st.one_of(manifolds(), soups())


def topologies(mesh, levels):
    return level_topologies(mesh.faces, len(mesh.vertices), levels)


@given(MESHES, st.integers(1, 2))
def test_positions_as_columns_give_loop(mesh, levels):
    expected = refine(mesh, loop(), levels).mesh.vertices
    refined = refine_linear(mesh.vertices, topologies(mesh, levels))
    np.testing.assert_array_equal(refined, expected)


@given(MESHES, st.integers(1, 7))
def test_columns_do_not_see_each_other(mesh, width):
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((len(mesh.vertices), width))
    steps = topologies(mesh, 2)
    together = refine_linear(columns, steps)
    for k in range(width):
        np.testing.assert_array_equal(together[:, k], refine_linear(columns[:, k:], steps)[:, 0])


@given(MESHES)
def test_weights_stay_a_partition_of_unity(mesh):
    rng = np.random.default_rng(0)
    columns = rng.random((len(mesh.vertices), 4))
    columns /= columns.sum(axis=1, keepdims=True)
    refined = refine_linear(columns, topologies(mesh, 2))
    assert (refined >= 0).all()
    np.testing.assert_allclose(refined.sum(axis=1), 1, atol=1e-14)


def test_creases_are_followed():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]])
    mesh = Mesh(vertices, np.array([[0, 1, 2], [2, 1, 3]]))
    crease = np.array([[2, 1]])
    expected = refine(mesh, loop(), 3, creases=crease).mesh.vertices
    steps = level_topologies(mesh.faces, 4, 3, Creases(crease))
    np.testing.assert_array_equal(refine_linear(vertices, steps), expected)


@pytest.mark.parametrize("kind", [np.int64, np.uint8])
def test_whole_numbers_have_halves(kind):
    mesh = Mesh(*bumpy_sphere(0))
    columns = (np.arange(len(mesh.vertices)) % 7)[:, None].astype(kind)
    steps = topologies(mesh, 2)
    expected = refine_linear(columns.astype(float), steps)
    np.testing.assert_array_equal(refine_linear(columns, steps), expected)


def test_columns_and_faces_of_another_mesh_are_refused():
    mesh = Mesh(*bumpy_sphere(0))
    with pytest.raises(ParameterError, match=r"columns.shape = \(41, 3\): expected \(42, K\)"):
        refine_linear(mesh.vertices[1:], topologies(mesh, 1))
    with pytest.raises(MeshError, match="expected 0 … 40"):
        level_topologies(mesh.faces, 41, 1)
