"""Adversaries reach the caps of the theorems and never pass them."""

from dataclasses import replace

import numpy as np

from pns_common.connectivity.topology import build_topology
from pns_common.geometry.frames import face_normals
from tests.support.meshes import rotation
from tests.support.recipes import both_rules
from train.certificates.adversary import (
    affine_attack,
    equivariance_attack,
    proximity_attack,
)
from train.certificates.affine import TURNED
from train.certificates.bodies import bumpy_sphere, synthetic_bodies
from train.certificates.displacement import bounded_displacement
from train.certificates.gap_collapse import gap_attack
from train.certificates.subject import subject_of_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model


def quiet(done, value):
    pass


def folding(mesh):
    """The largest x = 1 − n1 · n2 of a mesh: how far a search has bent it."""
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    n1, n2 = normals[topology.edge_faces[topology.interior]].transpose(1, 0, 2)
    return (1 - (n1 * n2).sum(axis=1)).max()


def test_the_proximity_adversary_finds_the_cap_and_never_passes_it():
    attack = proximity_attack(paper(0), 60, quiet)
    assert attack.values[0] < 0.1
    assert 0.999 < attack.worst <= attack.cap
    assert attack.held
    assert len(attack.values) == 60
    # What it has found holds in the product's code too.
    model = recipe_model(paper(0), attack.network)
    assert bounded_displacement(subject_of_network(model), synthetic_bodies(0), levels=1).passed


def test_the_equivariance_adversary_stays_at_rounding():
    attack = equivariance_attack(paper(0), 40, quiet)
    assert attack.held
    assert 0 < attack.worst < 1e-12
    # It did bend the mesh: the search was not idle.
    assert folding(attack.mesh) > folding(bumpy_sphere(0))


def test_the_affine_adversary_finds_nothing_on_an_axis_aligned_plane():
    attack = affine_attack(paper(0), np.eye(3), 0.0, 20, quiet)
    assert attack.worst == 0.0
    assert attack.held


def test_the_affine_adversary_stays_at_the_square_of_rounding_on_any_plane():
    turn = rotation(np.random.default_rng(0))
    attack = affine_attack(paper(0), turn, TURNED, 20, quiet)
    assert attack.held
    assert 0 < attack.worst < 1e-28
    assert folding(attack.mesh) < 1e-12


def test_a_passed_cap_is_not_held():
    attack = replace(affine_attack(paper(0), np.eye(3), 0.0, 1, quiet), values=(0.0, 1e-3))
    assert not attack.held
    assert not replace(attack, values=(0.0, float("nan"))).held


def test_the_same_seed_finds_the_same_and_another_seed_another():
    first, again = (proximity_attack(paper(3), 5, quiet).values for _ in range(2))
    assert first == again
    assert proximity_attack(paper(4), 5, quiet).values != first


def test_a_smaller_budget_leaves_the_adversary_a_wider_margin():
    narrow, wide = (
        gap_attack(replace(paper(0), budget=budget), 5, 10, quiet) for budget in (0.1, 1.0)
    )
    assert narrow.after > wide.after
    assert wide.after < wide.before
    assert narrow.after > 0.1


def test_with_the_vertex_rule_the_caps_are_found_and_held():
    """Weights of both networks and the mesh are searched at once."""
    recipe = both_rules(0)
    proximity = proximity_attack(recipe, 40, quiet)
    assert proximity.held
    assert proximity.worst > 0.999
    model = recipe_model(recipe, proximity.network, proximity.vertex_network)
    assert bounded_displacement(subject_of_network(model), synthetic_bodies(0), levels=1).passed

    equivariance = equivariance_attack(recipe, 15, quiet)
    assert equivariance.held
    assert equivariance.worst > 0

    on_axes = affine_attack(recipe, np.eye(3), 0.0, 10, quiet)
    # On a turned plane x is a rounding, ε, and the gate passes c ε² of it.
    rounding = recipe.gate_sharpness * (2 * np.finfo(float).eps) ** 2
    turned = affine_attack(recipe, rotation(np.random.default_rng(0)), rounding, 10, quiet)
    assert on_axes.worst == 0.0
    assert turned.held


def test_the_adversary_moves_the_vertex_network_too():
    before, after = (proximity_attack(both_rules(0), steps, quiet) for steps in (1, 8))
    weights = (
        subject.vertex_network.linear_layers[0].weight.detach() for subject in (before, after)
    )
    assert float(abs(next(weights) - next(weights)).max()) > 0.01
