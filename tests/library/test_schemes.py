"""Schemes are put together from a card as it says, with every number in its place."""

import copy
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, ModelError, ParameterError, load_model, loop, pns, refine
from pns_common.fused import load_kernels
from pns_common.fused.known import kernels_know
from pns_common.pieces import reach
from pns_common.runtimes.onnx_model import bundled_models
from pns_common.schemes import edge_operator, loop_vertex_rule, scale_free_form, vertex_operator
from tests.support.meshes import bumpy_sphere
from tests.support.networks import (
    SCALE_FREE_CARD,
    Float64Model,
    random_layers,
    scale_free_model,
    vertex_model,
)

# Every number another, so that none can stand in another's place.
NUMBERS = {
    "prior_strength": 0.9,
    "network_scale": 0.3,
    "fold_angle": 60.0,
    "learned_levels": 2,
    "boundary_strength": 0.7,
    "side_gates": True,
    "network_altitudes": 2.5,
    "wide_bound": True,
    "crease_prior": True,
    "tip_strength": 0.6,
    "even_prior_strength": 1.3,
}


def test_the_form_has_each_number_of_the_card_and_the_callers_budget():
    form = scale_free_form(replace(SCALE_FREE_CARD, **NUMBERS), 0.125)
    assert {name: getattr(form, name) for name in NUMBERS} == NUMBERS
    assert form.budget == 0.125


def test_a_scheme_says_what_its_rules_do():
    scheme = pns(scale_free_model(0, **NUMBERS, crease_angle=50.0, crease_levels=3), 4)
    assert (scheme.name, scheme.budget, scheme.model) == ("pns", 4.0, "scale-free")
    assert (scheme.learned_levels, scheme.moves_boundaries, scheme.wide_bound) == (2, True, True)
    assert scheme.guard.angle == math.radians(60)
    assert (scheme.creases.line_angle, scheme.creases.levels) == (50.0, 3)
    assert scheme.edge_rule.curves == scheme.vertex_rule.curves is not None
    plain = pns(scale_free_model(0))
    assert (plain.moves_boundaries, plain.wide_bound, plain.edge_rule.curves) == (
        *(False, False),
        None,
    )


def test_loop_has_no_learned_level_and_a_model_of_edges_leaves_vertices_to_it():
    assert loop().learned_levels == 0
    edges_alone = pns(Float64Model(random_layers(0)))
    assert edges_alone.vertex_rule is loop_vertex_rule
    assert (edges_alone.learned_levels, edges_alone.guard) == (None, None)


def test_a_strength_that_is_given_is_that_of_every_mesh():
    model = scale_free_model(prior_strength=0.8, even_prior_strength=1.2)
    assert pns(model).prior_strength is None
    scheme = pns(model, prior_strength=0)
    assert scheme.prior_strength == 0.0
    assert scheme.fitted(lambda: pytest.fail("it is given")) is scheme


@pytest.mark.parametrize("wrong", [-1, 100.001, 1e150, 10**400, math.nan, math.inf, True])
def test_a_strength_that_is_none_is_refused(wrong):
    with pytest.raises(ParameterError, match=r"prior_strength.*expected a number, 0 … 100"):
        pns(scale_free_model(), prior_strength=wrong)


def test_a_model_without_a_prior_has_no_strength_for_it():
    with pytest.raises(ParameterError, match="no prior"):
        pns(vertex_model(), prior_strength=1.0)


def test_networks_are_asked_at_a_budget_of_one():
    """What they answer is scaled afterwards, so one file serves every C / R."""
    asked = []

    class Asked(Float64Model):
        card = vertex_model().card

        def __init__(self):
            pass

        def __call__(self, features, budget):
            asked.append(("edges", budget))

        def vertex_correction(self, features, budget):
            asked.append(("vertices", budget))

    edge_operator(Asked()).network(np.zeros((1, 18)))
    vertex_operator(Asked()).network(np.zeros((1, 10)))
    assert asked == [("edges", 1.0), ("vertices", 1.0)]


def test_older_formats_have_no_scale_free_numbers():
    assert scale_free_form(vertex_model().card, 1.0) is None


def test_a_card_of_format_3_needs_a_vertex_network():
    class Without:
        name, hash, card = "without", "0" * 64, SCALE_FREE_CARD

        def __call__(self, features, budget):
            return np.zeros((len(features), 3))

    with pytest.raises(ModelError, match="vertex network"):
        pns(Without())


def test_rules_act_at_as_many_levels_as_the_scheme_says():
    two = pns(scale_free_model(0, learned_levels=2))
    assert [two.acts_at(level) for level in range(4)] == [True, True, False, False]
    assert not loop().acts_at(0)
    assert pns(load_model("paper")).acts_at(15)


@pytest.mark.parametrize(
    "wrong",
    [{"vertex_rule": None}, {"edge_rule": 1}, *({"learned_levels": k} for k in (-1, 1.5, "1"))],
)
def test_what_is_no_rule_or_no_number_of_levels_is_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        replace(loop(), **wrong)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_scheme_travels_with_its_kernels(again):
    mesh = Mesh(*bumpy_sphere(0))
    load_kernels()
    for scheme in (loop(), *(pns(load_model(name)) for name in bundled_models())):
        there = again(scheme)
        assert kernels_know(there) == kernels_know(scheme)
        assert [reach(there, level) for level in (0, 1)] == [
            reach(scheme, level) for level in (0, 1)
        ]
        ours, theirs = (refine(mesh, each, 2, creases=None) for each in (scheme, there))
        np.testing.assert_array_equal(theirs.mesh.vertices, ours.mesh.vertices)
        assert theirs.report == ours.report
