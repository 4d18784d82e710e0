"""Columns refined by kernels: the bits of the array kernels, whoever refines them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, crease_lines, loop, refine
from pns_common.connectivity.creases import NO_CREASES
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import linear
from pns_common.fused.where_loaded.linear import FusedLinearRefinement, linear_refinement
from pns_common.masks.linear import LinearRefinement, level_topologies
from tests.support.kernels import edges_of
from tests.support.meshes import block, manifolds, soups

MESHES = st.one_of(manifolds(), soups())


def refiners(mesh, levels, creases=None, *, limit=False):
    load_kernels()
    count = len(mesh.vertices)
    arrays = LinearRefinement(level_topologies(mesh.faces, count, levels, Creases(creases)), limit)
    return arrays, linear_refinement(mesh.faces, count, levels, Creases(creases), limit=limit)


@given(MESHES, st.integers(1, 7), st.integers(1, 2), st.booleans(), st.booleans())
def test_columns_have_the_bits_of_the_arrays(mesh, width, levels, sharp, limit):
    creases = edges_of(mesh, 3, 0) if sharp else None
    arrays, kernels = refiners(mesh, levels, creases, limit=limit)
    assert isinstance(kernels, FusedLinearRefinement)
    assert kernels.count == arrays.count
    columns = np.random.default_rng(0).standard_normal((len(mesh.vertices), width))
    refined = kernels(columns)
    assert refined.tobytes() == np.ascontiguousarray(arrays(columns)).tobytes()


@pytest.mark.parametrize("loaded", [False, True])
def test_kernels_serve_where_they_are_loaded(loaded, monkeypatch):
    monkeypatch.setattr(linear, "kernels_loaded", lambda: loaded)
    made = linear_refinement(np.array([[0, 1, 2]]), 3, 1, NO_CREASES, limit=False)
    assert isinstance(made, FusedLinearRefinement) is loaded


def test_columns_follow_points_past_the_levels_at_which_creases_are_sharp():
    mesh = Mesh(*block(2))
    creases = Creases(crease_lines(mesh), levels=2)
    count = len(mesh.vertices)
    expected = refine(mesh, loop(), 3, creases=creases).mesh.vertices
    by_arrays = LinearRefinement(level_topologies(mesh.faces, count, 3, creases), False)
    by_kernels = linear_refinement(mesh.faces, count, 3, creases, limit=False)
    for made in (by_arrays, by_kernels):
        np.testing.assert_array_equal(made(mesh.vertices), expected)
