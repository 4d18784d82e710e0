"""The star term sees the margin that the certificates measure, and its slope is the margin's."""

import copy

import pytest
import torch

from pns_common import pns
from train.recipe_operator import (
    initial_network,
    initial_vertex_network,
    recipe_operator,
    vertex_rule_operator,
)
from train.recipes import full
from train.spectrum import continued_spectrum, follow_lift, loop_gap
from train.star_term import StarTerm, perturbed_points, star_copies, star_jacobian
from train.torch_model import recipe_model

RECIPE = full(1)


def networks(scale=1.0):
    both = (initial_network(RECIPE).double(), initial_vertex_network(RECIPE).double())
    for network in both:
        with torch.no_grad():
            for weight in network.parameters():
                weight *= scale
    return both


def rules(network, vertex_network):
    return recipe_operator(RECIPE, network), vertex_rule_operator(RECIPE.vertex, vertex_network)


def spectrum_at(copies, lift, operator, vertices):
    points = perturbed_points(copies, lift)
    matrix = star_jacobian(copies, points, operator, RECIPE.budget, vertices).detach().numpy()
    basis = copies.quotient
    return continued_spectrum(basis.T @ matrix @ basis, copies.flat)


@pytest.mark.parametrize("valence", [3, 5])
def test_it_measures_what_the_certificates_measure(valence):
    network, vertex_network = networks(1.5)
    copies = star_copies(valence)
    found = spectrum_at(copies, 0.1, *rules(network, vertex_network)).margin
    scheme = pns(recipe_model(RECIPE, network, vertex_network))
    expected = follow_lift(scheme, valence, [0.0, 0.1])[-1].margin
    assert found == pytest.approx(expected, abs=2e-3)
    assert abs(found - loop_gap(valence)) > 1e-3


def test_its_slope_is_the_margins():
    network, vertex_network = networks(1.5)

    class OneStar(StarTerm):
        """Always the same star, lifted up to a third of the highest."""

        def __init__(self):
            super().__init__(0, wanted=1.0, shares=((4, 1.0),))
            self._rng = self

        def choice(self, valences, p):
            return 4

        def uniform(self, low, high):
            return 1 / 3

    term = OneStar()
    weight = network.linear_layers[-1].weight
    operator, vertices = rules(network, vertex_network)
    term(operator, RECIPE.budget, vertices).backward()
    direction = torch.randn(
        weight.shape, dtype=weight.dtype, generator=torch.Generator().manual_seed(0)
    )
    slope = float((weight.grad * direction).sum())
    values = []
    for step in (1e-5, -1e-5):
        moved = copy.deepcopy(network)
        with torch.no_grad():
            moved.linear_layers[-1].weight += step * direction
        values.append(float(term(*_pair(rules(moved, vertex_network))).detach()))
    assert slope == pytest.approx((values[0] - values[1]) / 2e-5, rel=1e-3)
    assert abs(slope) > 1e-6


def _pair(found):
    operator, vertices = found
    return operator, RECIPE.budget, vertices


def test_a_wide_margin_costs_nothing():
    network, vertex_network = networks(0.0)
    term = StarTerm(0, loop_gap(3) - 0.02, ((3, 0.5), (4, 0.5)))
    assert all(float(term(*_pair(rules(network, vertex_network))).detach()) == 0 for _ in range(3))


def test_every_drawn_valence_has_its_share():
    for plan in (RECIPE.stream, RECIPE.polish.stream):
        shares = dict(plan.star_shares)
        assert sum(shares.values()) == pytest.approx(1)
        assert {3, 4, 5, 6, 12} <= set(shares)
