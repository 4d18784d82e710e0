"""A promise for any weights holds for the worst that a search over weights and mesh finds."""

from dataclasses import replace

import numpy as np
import pytest

import train.directed_rule as oracle
from pns_common import Mesh
from tests.support.meshes import TETRAHEDRON, bent, bumpy_sphere, grid, rotation
from train.certificates.adversary import (
    affine_attack,
    equivariance_attack,
    proximity_attack,
)
from train.certificates.affine import TURNED
from train.certificates.ascent import GOALS, ascend
from train.certificates.bodies import synthetic_bodies
from train.certificates.displacement import bounded_displacement
from train.certificates.gap_collapse import gap_attack
from train.certificates.subject import subject_of_network
from train.models.recipe import DirectedForm
from train.models.recipes import paper
from train.models.torch_model import recipe_model

FORM = DirectedForm(
    base="loop",
    width=4,
    hidden=6,
    rounds=2,
    budget=20.0,
    gate_sharpness=1e6,
    vertex_gate_sharpness=1e3,
    network_scale=0.4,
    curve_strength=0.0,
    fold_angle=75.0,
    sharpness_levels=2,
)
LOOSE = replace(FORM, network_scale=2.0, curve_strength=1.0)
CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
MESHES = {
    "sphere": Mesh(*bumpy_sphere(0, subdivisions=0, bump=0.2)),
    "patch": Mesh(*grid(4, bent)),
    "tetrahedron": Mesh(CORNERS, TETRAHEDRON),
}
ALLOWED = 1 + 1e-9


def quiet(done, value):
    pass


def test_the_proximity_adversary_finds_the_cap_and_never_passes_it():
    attack = proximity_attack(paper(0), 60, quiet)
    assert attack.values[0] < 0.1
    assert 0.999 < attack.worst <= attack.cap
    assert attack.held
    # What it has found holds in the product's code too.
    model = recipe_model(paper(0), attack.network)
    assert bounded_displacement(subject_of_network(model), synthetic_bodies(0), levels=1).passed


def test_the_equivariance_adversary_stays_at_rounding():
    attack = equivariance_attack(paper(0), 30, quiet)
    assert attack.held
    assert 0 < attack.worst < 1e-12


def test_the_affine_adversary_finds_nothing_but_the_square_of_rounding():
    assert affine_attack(paper(0), np.eye(3), 0.0, 15, quiet).worst == 0.0
    turned = affine_attack(paper(0), rotation(np.random.default_rng(0)), TURNED, 15, quiet)
    assert turned.held
    assert 0 < turned.worst < 1e-28


def test_a_smaller_budget_leaves_the_adversary_of_the_gap_a_wider_margin():
    narrow, wide = (
        gap_attack(replace(paper(0), budget=budget), 5, 10, quiet) for budget in (0.1, 1.0)
    )
    assert narrow.after > max(wide.after, 0.1)
    assert wide.after < wide.before


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize(("form", "loudness"), [(FORM, 1.0), (LOOSE, 100.0)])
def test_no_search_over_weights_and_mesh_breaks_a_promise(goal, mesh, form, loudness):
    worst = ascend(GOALS[goal], MESHES[mesh], form, seed=0, steps=10, loudness=loudness)
    for promise in ("turn", "displacement", "limit", "overshoot"):
        assert getattr(worst, promise) <= ALLOWED, (promise, worst)


@pytest.mark.parametrize("goal", GOALS)
def test_the_searches_climb(goal):
    """From usual weights: a search that stands still proves nothing."""
    assert ascend(GOALS[goal], MESHES["sphere"], FORM, seed=0, steps=25).climbed > 0


def test_without_the_guard_the_same_search_folds_faces(monkeypatch):
    monkeypatch.setattr(oracle, "fold_guard", lambda faces, base, *rest: 0 * base[:, 0] + 1)
    assert ascend(GOALS["fold"], MESHES["sphere"], LOOSE, seed=0, steps=25).turn > 1


def test_without_the_projection_the_same_search_leaves_the_envelope(monkeypatch):
    search = GOALS["limit distance"], MESHES["sphere"], replace(FORM, budget=0.05)
    held = ascend(*search, seed=0, steps=10)
    assert 0.9 < held.displacement <= ALLOWED
    monkeypatch.setattr(oracle, "shortened", lambda vectors, longest: vectors)
    assert ascend(*search, seed=0, steps=10).displacement > 1.5
