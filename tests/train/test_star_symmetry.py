"""Blocks of a star: what is symmetric keeps them, and they leave nothing out."""

import numpy as np
import pytest

from pns_common import load_model, loop, pns
from train.recipe_operator import initial_network, initial_vertex_network
from train.recipes import full
from train.spectrum import (
    SPOKE,
    continued_spectrum,
    flat_spectrum,
    follow_lift,
    jacobian,
    quotient_blocks,
    without_translations,
)
from train.star_symmetry import keeps_blocks, symmetry_blocks
from train.stars import star
from train.torch_model import recipe_model

RECIPE = full(0)
SYMMETRIC = pns(
    recipe_model(RECIPE, initial_network(RECIPE).double(), initial_vertex_network(RECIPE).double())
)


@pytest.mark.parametrize("valence", [3, 4, 5, 6, 12])
def test_the_blocks_are_an_orthonormal_basis_of_everything(valence):
    basis = np.concatenate(symmetry_blocks(star(valence, 3, SPOKE), valence), axis=1)
    np.testing.assert_allclose(basis.T @ basis, np.eye(len(basis)), atol=1e-12)


@pytest.mark.parametrize("valence", [3, 4, 6])
def test_symmetric_rules_keep_the_blocks_of_lifted_stars(valence):
    at = star(valence, 4, SPOKE, 0.3, inner_rings=3)
    blocks = symmetry_blocks(at, valence)
    assert keeps_blocks(jacobian(loop(), at), blocks)
    assert keeps_blocks(jacobian(SYMMETRIC, at), blocks)


def test_a_rule_that_depends_on_numbering_does_not():
    at = star(5, 2, SPOKE, 0.3)
    assert not keeps_blocks(jacobian(pns(load_model("paper")), at), symmetry_blocks(at, 5))


def test_a_lopsided_star_does_not():
    at = star(5, 4, SPOKE, 0.3, inner_rings=3)
    at.mesh.vertices.setflags(write=True)
    at.mesh.vertices[7, 2] += 0.1 * SPOKE
    assert not keeps_blocks(jacobian(SYMMETRIC, at), symmetry_blocks(at, 5))


@pytest.mark.parametrize("valence", [3, 4, 5])
def test_blocks_have_the_whole_spectrum(valence):
    at = star(valence, 4, SPOKE, 0.2, inner_rings=3)
    matrix = without_translations(jacobian(SYMMETRIC, at))
    found = flat_spectrum(matrix, valence, quotient_blocks(at, valence))
    expected = np.linalg.eigvals(matrix)
    assert len(found.values) == len(expected)
    for value in expected:
        assert np.abs(found.values - value).min() < 1e-5
    np.testing.assert_allclose((found.right * found.values @ found.left).real, matrix, atol=1e-7)


def test_each_block_keeps_its_number_of_tangents():
    """A flat star's six: two of frequency 0, and the pairs of frequencies 1 and 2."""
    for found in follow_lift(SYMMETRIC, 5, [0.0, 0.2, 0.4]):
        counts = np.bincount(found.block[found.tangent], minlength=len(found.blocks))
        assert counts.tolist() == [1, 1, 1, 1, 1, 1]


def test_eigenvalues_that_cross_from_different_blocks_are_told_apart():
    """In one stride: a tangent of one block comes to lie below another block's rest."""
    blocks = (np.eye(8)[:, :2], np.eye(8)[:, 2:])
    before = np.diag([0.5, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.2])
    after = np.diag([0.2, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.4])
    after[6, 7] = 5.0  # far from normal
    found = continued_spectrum(after, flat_spectrum(before, 6, blocks))
    assert found.tangent.tolist() == [True, False, True, True, True, True, True, False]
    assert found.margin == pytest.approx(-0.2)


def test_eigenvalues_that_just_meet_do_not_stop_the_search():
    matrix = np.diag([0.5] * 6 + [0.2, 0.2])
    matrix[6, 7] = 1.0  # a Jordan block: one eigenvector for two eigenvalues
    found = continued_spectrum(matrix, flat_spectrum(np.diag([0.5] * 6 + [0.2, 0.1]), 6))
    assert found.margin == pytest.approx(0.3)
    assert np.isfinite(found.left).all()
