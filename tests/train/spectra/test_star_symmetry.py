"""Blocks of a star: what is symmetric keeps them, and they leave nothing out."""

import numpy as np
import pytest

from pns_common import load_model, loop, pns
from tests.support.recipes import both_rules
from train.models.from_recipe import initial_network, initial_vertex_network
from train.models.torch_model import recipe_model
from train.spectra.spectrum import (
    SPOKE,
    continued_spectrum,
    flat_spectrum,
    follow_lift,
    jacobian,
    quotient_blocks,
    without_translations,
)
from train.spectra.star_symmetry import keeps_blocks, symmetry_blocks
from train.spectra.stars import star

RECIPE = both_rules(0)
SYMMETRIC = pns(
    recipe_model(RECIPE, initial_network(RECIPE).double(), initial_vertex_network(RECIPE).double())
)


@pytest.mark.parametrize("valence", [3, 4, 5, 6, 12])
def test_the_blocks_are_an_orthonormal_basis_of_everything(valence):
    basis = np.concatenate(symmetry_blocks(star(valence, 3, SPOKE), valence), axis=1)
    np.testing.assert_allclose(basis.T @ basis, np.eye(len(basis)), atol=1e-12)


@pytest.mark.parametrize("valence", [3, 4, 6])
def test_symmetric_rules_keep_the_blocks_of_lifted_stars(valence):
    fan = star(valence, 4, SPOKE, 0.3, inner_rings=3)
    blocks = symmetry_blocks(fan, valence)
    assert keeps_blocks(jacobian(loop(), fan), blocks)
    assert keeps_blocks(jacobian(SYMMETRIC, fan), blocks)


def test_a_rule_that_depends_on_numbering_does_not():
    fan = star(5, 2, SPOKE, 0.3)
    assert not keeps_blocks(jacobian(pns(load_model("paper")), fan), symmetry_blocks(fan, 5))


def test_a_lopsided_star_does_not():
    fan = star(5, 4, SPOKE, 0.3, inner_rings=3)
    fan.mesh.vertices.setflags(write=True)
    fan.mesh.vertices[7, 2] += 0.1 * SPOKE
    assert not keeps_blocks(jacobian(SYMMETRIC, fan), symmetry_blocks(fan, 5))


@pytest.mark.parametrize("valence", [3, 4, 5])
def test_blocks_have_the_whole_spectrum(valence):
    fan = star(valence, 4, SPOKE, 0.2, inner_rings=3)
    matrix = without_translations(jacobian(SYMMETRIC, fan))
    flat = flat_spectrum(matrix, valence, quotient_blocks(fan, valence))
    expected = np.linalg.eigvals(matrix)
    assert len(flat.values) == len(expected)
    for value in expected:
        assert np.abs(flat.values - value).min() < 1e-5
    np.testing.assert_allclose((flat.right * flat.values @ flat.left).real, matrix, atol=1e-7)


def test_each_block_keeps_its_number_of_tangents():
    """A flat star's six: two of frequency 0, and the pairs of frequencies 1 and 2."""
    for followed in follow_lift(SYMMETRIC, 5, [0.0, 0.2, 0.4]):
        counts = np.bincount(followed.block[followed.tangent], minlength=len(followed.blocks))
        assert counts.tolist() == [1, 1, 1, 1, 1, 1]


def test_eigenvalues_that_cross_from_different_blocks_are_told_apart():
    """In one stride: a tangent of one block comes to lie below another block's rest."""
    blocks = (np.eye(8)[:, :2], np.eye(8)[:, 2:])
    before = np.diag([0.5, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.2])
    after = np.diag([0.2, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.4])
    after[6, 7] = 5.0  # far from normal
    continued = continued_spectrum(after, flat_spectrum(before, 6, blocks))
    assert continued.tangent.tolist() == [True, False, True, True, True, True, True, False]
    assert continued.margin == pytest.approx(-0.2)


def test_eigenvalues_that_just_meet_do_not_stop_the_search():
    matrix = np.diag([0.5] * 6 + [0.2, 0.2])
    matrix[6, 7] = 1.0  # a Jordan block: one eigenvector for two eigenvalues
    continued = continued_spectrum(matrix, flat_spectrum(np.diag([0.5] * 6 + [0.2, 0.1]), 6))
    assert continued.margin == pytest.approx(0.3)
    assert np.isfinite(continued.left).all()
