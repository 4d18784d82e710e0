"""A promise for any weights holds for the worst that a search over weights and mesh finds."""

from dataclasses import replace

import numpy as np

from tests.support.meshes import rotation
from train.certificates.adversary import affine_attack, equivariance_attack, proximity_attack
from train.certificates.affine import TURNED
from train.certificates.bodies import synthetic_bodies
from train.certificates.displacement import bounded_displacement
from train.certificates.gap_collapse import gap_attack
from train.certificates.subject import subject_of_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model


def test_the_proximity_adversary_finds_the_cap_and_never_passes_it():
    attack = proximity_attack(paper(0), 60)
    assert attack.values[0] < 0.1
    assert 0.999 < attack.worst <= attack.cap
    assert attack.held
    # What it has found holds in the product's code too.
    model = recipe_model(paper(0), attack.network)
    assert bounded_displacement(subject_of_network(model), synthetic_bodies(0), levels=1).passed


def test_the_adversaries_of_motion_and_planes_stay_at_rounding():
    moved = equivariance_attack(paper(0), 30)
    assert moved.held
    assert 0 < moved.worst < 1e-12
    assert affine_attack(paper(0), np.eye(3), 0.0, 15).worst == 0.0
    turned = affine_attack(paper(0), rotation(np.random.default_rng(0)), TURNED, 15)
    assert turned.held
    assert 0 < turned.worst < 1e-28


def test_a_smaller_budget_leaves_the_adversary_of_the_gap_a_wider_margin():
    narrow, wide = (gap_attack(replace(paper(0), budget=budget), 5, 10) for budget in (0.1, 1.0))
    assert narrow.after > max(wide.after, 0.1)
    assert wide.after < wide.before
