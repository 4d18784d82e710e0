"""Stars and spectra against Loop's closed forms, an independent matrix and autograd."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from pns_common import ParameterError, Scheme, loop, pns
from train.certificates.adversary import Operator
from train.certificates.gap_collapse import margin_gradient, operator_jacobian
from train.models.from_recipe import initial_network
from train.models.networks import BoundedNet
from train.models.recipes import paper, signed
from train.models.torch_model import recipe_model
from train.refining import additions
from train.spectra.spectrum import (
    SPOKE,
    VALENCES,
    closed_star,
    continued_spectrum,
    flat_spectrum,
    follow_lift,
    jacobian,
    loop_gap,
    without_translations,
)
from train.spectra.stars import keeps_blocks, star, symmetry_blocks


def steep_network(seed=0, scale=4.0):
    generator = torch.Generator().manual_seed(seed)
    network = BoundedNet(5, (32, 32), "gelu", generator).double()
    with torch.no_grad():
        for weight in network.parameters():
            weight *= scale
    return network


@pytest.mark.parametrize("k", VALENCES)
def test_loops_spectrum_is_the_closed_form(k):
    matrix = without_translations(jacobian(loop(), star(k, 2, SPOKE)))
    size = np.sort(np.abs(np.linalg.eigvals(matrix)))[::-1]
    np.testing.assert_allclose(size[:6], 3 / 8 + math.cos(2 * math.pi / k) / 4, atol=1e-10)
    assert size[5] - size[6] == pytest.approx(loop_gap(k), abs=1e-10)


@pytest.mark.parametrize("lift", [0.0, 0.3])
def test_differences_agree_with_autograd_through_the_kernels(lift):
    network, recipe, fan = steep_network(), paper(), star(5, 2, SPOKE, lift)
    exact = operator_jacobian(Operator(network, recipe), fan).numpy()
    differences = jacobian(pns(recipe_model(recipe, network)), fan)
    np.testing.assert_allclose(differences, exact, atol=1e-8)
    base = jacobian(loop(), fan)
    if lift:
        assert np.abs(exact - base).max() > 1e-3
    else:
        np.testing.assert_allclose(exact, base, atol=1e-10)


def test_the_margins_gradient_is_its_derivative():
    rng = np.random.default_rng(0)
    scheme = pns(recipe_model(paper(), steep_network(scale=2.0)))
    followed = follow_lift(scheme, 6, np.linspace(0, 0.4, 9))[-1]
    matrix = (followed.right * followed.values @ followed.left).real
    change = rng.standard_normal(matrix.shape)
    up, down = (continued_spectrum(matrix + s * 1e-7 * change, followed).margin for s in (1, -1))
    expected = (margin_gradient(followed) * change).sum()
    assert (up - down) / 2e-7 == pytest.approx(expected, rel=1e-4)


def far_sighted(rings):
    """Loop, and on every edge a pull towards the vertices that are `rings` rings of edges away."""

    def rule(level):
        edges, count = level.topology.edges.astype(int), len(level.points)
        near = np.eye(count)
        near[edges[:, 0], edges[:, 1]] = near[edges[:, 1], edges[:, 0]] = 1
        seen = np.linalg.matrix_power(near, rings)
        pull = (seen / seen.sum(axis=1, keepdims=True)) @ level.points
        base = level.base.place(level.points, level.topology, level.blocks)
        moved = 0.01 * (pull[edges].mean(axis=1) - base[count:])
        none = np.zeros(len(base))
        return additions(level, np.concatenate([np.zeros((count, 3)), moved]), none, none)

    return Scheme("far-sighted", rule=rule, learned_levels=None)


def test_a_rule_that_sees_further_gets_more_rings():
    assert len(closed_star(loop(), 5)(0.0).inner) == 1 + 5 + 10
    assert len(closed_star(far_sighted(1), 5)(0.0).inner) == 1 + 5 + 10
    assert len(closed_star(far_sighted(2), 5)(0.0).inner) == 1 + 5 + 10 + 15 + 20
    with pytest.raises(ParameterError, match="far-sighted"):
        closed_star(far_sighted(9), 5)


RECIPE = replace(signed(0), hidden=(24, 24), budget=0.8, gate_sharpness=1e5)
SYMMETRIC = pns(recipe_model(RECIPE, initial_network(RECIPE).double()))


@pytest.mark.parametrize("valence", [3, 4, 6])
def test_symmetric_rules_keep_the_blocks_of_lifted_stars(valence):
    fan = star(valence, 4, SPOKE, 0.3, inner_rings=3)
    blocks = symmetry_blocks(fan, valence)
    assert keeps_blocks(jacobian(loop(), fan), blocks)
    assert keeps_blocks(jacobian(SYMMETRIC, fan), blocks)


def test_eigenvalues_that_cross_from_different_blocks_are_told_apart():
    """In one stride: a tangent of one block comes to lie below another block's rest."""
    blocks = (np.eye(8)[:, :2], np.eye(8)[:, 2:])
    before = np.diag([0.5, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.2])
    after = np.diag([0.2, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5, 0.4])
    after[6, 7] = 5.0  # far from normal
    continued = continued_spectrum(after, flat_spectrum(before, 6, blocks))
    assert continued.tangent.tolist() == [True, False, True, True, True, True, True, False]
    assert continued.margin == pytest.approx(-0.2)
