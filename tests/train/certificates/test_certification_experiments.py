"""Claims of the structural, spectral and lifted-stars tables, on the pieces they are made of."""

import numpy as np
import pytest

from tests.support.shared import shared_path
from train.ablations.variants import VARIANTS, variant_recipe
from train.certificates.adversary import Operator
from train.certificates.affine import affine_reproduction
from train.certificates.bodies import flat_bodies, synthetic_bodies
from train.certificates.displacement import bounded_displacement
from train.certificates.equivariance import equivariance
from train.certificates.planar_spectrum import planar_spectrum
from train.certificates.scaling import normal_variation_slope, proximity_slope
from train.certificates.subject import in_double, subject_of_network
from train.experiments.beyond.lifted_stars import lifted_star_row
from train.experiments.paper import spectral
from train.experiments.paper.structural import scaled, variant_subject
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.spectra.spectrum import follow_lift

BODIES = synthetic_bodies(0)


def lacking(name):
    """An operator without one part; its random weights are steep enough to use their freedom."""
    recipe = variant_recipe(paper(), VARIANTS[name])
    return variant_subject(name, scaled(initial_network(recipe), 5.0), recipe)


def fails(certificates):
    return any(not certificate.passed for certificate in certificates)


def test_the_gate_protects_planes_and_the_planar_spectrum():
    assert fails(affine_reproduction(lacking("no-gate"), flat_bodies(0)[:1], 0))
    assert fails(planar_spectrum(lacking("no-gate"), valences=(5,)))
    assert not fails([bounded_displacement(lacking("no-gate"), BODIES, levels=1)])


def test_the_square_of_h_protects_the_orders():
    assert fails([proximity_slope(lacking("no-h2"), BODIES)])
    assert fails([normal_variation_slope(lacking("no-h2"), BODIES)])
    assert not fails(affine_reproduction(lacking("no-h2"), flat_bodies(0)[:1], 0))


def test_the_bound_protects_the_displacement():
    assert fails([bounded_displacement(lacking("unbounded"), BODIES, levels=1)])
    assert not fails(equivariance(lacking("unbounded"), BODIES, 0))


def test_an_unconstrained_network_keeps_nothing():
    subject = lacking("unconstrained")
    assert fails([bounded_displacement(subject, BODIES, levels=1)])
    assert fails(equivariance(subject, BODIES, 0))
    assert fails(affine_reproduction(subject, flat_bodies(0)[:1], 0))
    assert fails([proximity_slope(subject, BODIES)])


@pytest.mark.parametrize("valence", [3, 7])
def test_the_planar_spectrum_comes_out_as_published(valence):
    network = initial_network(paper())
    exact = subject_of_network(recipe_model(paper(), network)).exact
    row = spectral.planar_row(exact, Operator(in_double(network), paper()), valence)
    assert row.tangent == pytest.approx(row.published_tangent, abs=5e-10)
    assert row.gap_one_ring == pytest.approx(row.published_gap, abs=5e-7)
    assert row.gap == pytest.approx(row.gap_analytic, abs=1e-9)
    assert row.departure_autograd == 0
    assert row.departure < 1e-9


def test_the_published_table_is_copied_rightly():
    path = shared_path("published") / "spectral_certification.csv"
    for line in path.read_text().split()[1:]:
        valence, tangent, _, gap, _ = line.split(",")
        assert spectral.PUBLISHED_SPECTRAL[valence] == (float(tangent), float(gap))


def test_stars_drift_in_proportion_to_the_budget():
    model = recipe_model(paper(), initial_network(paper()))
    drift = []
    for budget in (0.25, 0.5):
        scheme = subject_of_network(model, budget).exact
        flat, lifted = follow_lift(scheme, 4, np.array([0.0, 0.2]))
        row = lifted_star_row(4, budget, 0.0, flat)
        assert row.margin == pytest.approx(row.loop_gap, abs=1e-9)
        drift.append(lifted_star_row(4, budget, 0.2, lifted).drift)
    assert drift[1] / drift[0] == pytest.approx(2, rel=0.1)
