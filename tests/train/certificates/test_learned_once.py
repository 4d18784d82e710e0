"""The certificates of schemes that correct once: each passes for any weights, and can fail."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, Mesh, load_model, loop, pns
from pns_common.rules.placement import Placement
from pns_common.rules.scale_free import ScaleFreeEdgeRule
from pns_common.schemes import loop_edge_rule, loop_vertex_rule, scale_free_form
from tests.support.meshes import bumpy_sphere, icosphere
from tests.support.networks import SCALE_FREE_CARD, scale_free_model
from train.certificates.bodies import Body, spiky_sphere, synthetic_bodies
from train.certificates.certify import scheme_steps
from train.certificates.displacement import bounded_displacement
from train.certificates.learned_once import (
    fold_free,
    largest_turn,
    limit_distance,
    resolution_independence,
    smoothness_class,
)
from train.certificates.planar_spectrum import planar_spectrum
from train.certificates.subject import Subject
from train.data.primitives import box, cylinder

BODIES = (*synthetic_bodies(0), Body("rough", Mesh(*bumpy_sphere(0, bump=0.4))))
CERTIFICATES = (fold_free, limit_distance, smoothness_class, resolution_independence)


def subject_of_scheme(scheme, budget):
    """A scheme that is double precision throughout."""
    return Subject(scheme.name, scheme, scheme, budget)


def subject(scale=2.0, seed=0, **changes):
    return subject_of_scheme(pns(scale_free_model(seed, scale, **changes)), SCALE_FREE_CARD.budget)


@pytest.mark.parametrize("certificate", CERTIFICATES)
@pytest.mark.parametrize("scale", [0.0, 2.0, 200.0])
@pytest.mark.parametrize("changes", [{}, {"boundary_strength": 1.0}, {"learned_levels": 2}])
def test_any_weights_pass(certificate, scale, changes):
    if certificate is smoothness_class or changes == {} or scale == 2.0:
        result = certificate(subject(scale, **changes), BODIES)
        assert result.passed, (result.value, result.where)


@pytest.mark.parametrize("certificate", CERTIFICATES)
def test_the_default_passes_on_meshes_whose_lines_it_keeps(certificate):
    general = subject_of_scheme(pns(load_model()), 20.0)
    assert certificate(general, [Body("box", box()), Body("cylinder", cylinder(16, rows=3))]).passed


def test_lines_that_are_sharp_for_good_are_not_smooth():
    scheme = replace(loop(), creases=Creases(line_angle=66.0))
    assert not smoothness_class(subject_of_scheme(scheme, 0.0), [Body("box", box())]).passed


def test_rules_without_a_guard_fold():
    wild = subject(200.0, network_scale=3.0)
    bare = replace(wild, scheme=replace(wild.scheme, guard=None))
    result = fold_free(bare, BODIES)
    assert result.value > 75
    assert not result.passed
    assert fold_free(wild, BODIES).passed


@pytest.mark.parametrize("seed", [0, 1])
def test_the_default_is_certified_where_its_guard_acts(seed):
    general = subject_of_scheme(pns(load_model()), 10.0)
    bare = replace(general, scheme=replace(general.scheme, guard=None))
    (folds,) = (step for step in scheme_steps(general, (), seed, ()) if step.theorem == "folds")
    result = folds.work()
    assert result.passed, (result.value, result.where)
    assert fold_free(bare, [Body("spiky sphere", spiky_sphere(seed))]).value > 90


def test_a_scale_free_rule_beyond_its_budget_is_found():
    """At the size of a certificate's meshes it asks for less than the budget anyway."""
    sound = subject()
    assert bounded_displacement(sound, BODIES, levels=1).passed
    assert not bounded_displacement(replace(sound, budget=sound.budget / 2), BODIES, 1).passed


def test_crease_lines_do_not_count_against_the_bound():
    tight = pns(load_model(), budget=0.05)
    box_alone = [Body("box", box())]
    assert tight.creases.levels > 0
    assert bounded_displacement(subject_of_scheme(tight, 0.05), box_alone, levels=1).passed


def test_curves_beyond_their_bound_are_found_at_creases():
    """Nothing else is moved: no network, no prior of the surface, no boundary."""
    still = {"prior_strength": 0.0, "boundary_strength": 1.0, "crease_prior": True}
    curves, closed = subject(0.0, **still), BODIES[3:]
    honest = bounded_displacement(curves, closed, 1)
    assert honest.passed
    assert honest.value > 0.999
    beyond = bounded_displacement(replace(curves, budget=curves.budget / 1.01), closed, 1)
    assert not beyond.passed
    assert beyond.where.startswith("creased")


def test_a_guard_that_is_looser_than_it_says_is_found():
    wild = subject(200.0)
    honest = fold_free(wild, BODIES)
    loose = replace(wild.scheme.guard, angle=math.radians(85))
    claimed = replace(honest, value=fold_free_value(wild, loose))
    assert not claimed.passed


def fold_free_value(wild, guard):
    return fold_free(replace(wild, scheme=replace(wild.scheme, guard=guard)), BODIES).value


def test_a_displacement_that_the_report_hides_breaks_the_limit_distance():
    def hidden(level):
        base = loop_edge_rule(level)
        return Placement(base.loop + 1e-3, None, base.ratio, base.gate, base.degenerate)

    result = limit_distance(
        subject_of_scheme(replace(loop(), edge_rule=hidden, learned_levels=1), 1.0), BODIES
    )
    assert not result.passed
    assert result.value > 10


def test_a_displacement_beyond_the_bound_breaks_it_too():
    def claims_less(level):
        base = loop_edge_rule(level)
        moved = np.full_like(base.loop, 1e-3)
        bound = np.full(len(moved), 1e-4)
        return replace(base, displacement=moved, envelope=bound)

    result = limit_distance(
        subject_of_scheme(replace(loop(), edge_rule=claims_less, learned_levels=1), 1.0), BODIES
    )
    assert not result.passed
    assert result.where.endswith("bound")


def test_a_scheme_that_corrects_at_every_level_has_no_class():
    paper = subject_of_scheme(pns(load_model("paper")), 0.5)
    assert not smoothness_class(paper, BODIES).passed


def test_a_scheme_that_goes_on_past_its_levels_is_found():
    """It says one level and acts at two: what follows is not Loop's."""
    two = subject(learned_levels=2)

    class Once(type(two.scheme)):
        asked = 0

        @property
        def learned_levels(self):
            # The certificate asks first, then every level does.
            type(self).asked += 1
            return 1 if type(self).asked == 1 else 2

        @learned_levels.setter
        def learned_levels(self, value):
            pass

    fields = {name: getattr(two.scheme, name) for name in type(two.scheme).__dataclass_fields__}
    lying = object.__new__(Once)
    for name, value in fields.items():
        if name != "learned_levels":
            object.__setattr__(lying, name, value)
    result = smoothness_class(replace(two, scheme=lying), BODIES[:1])
    assert not result.passed


@pytest.mark.parametrize("model", ["paper", "signed"])
def test_a_rule_in_squared_edge_lengths_depends_on_resolution(model):
    squared = subject_of_scheme(pns(load_model(model)), 0.5)
    result = resolution_independence(squared, BODIES)
    assert not result.passed
    assert result.value > 0.5


def test_loop_passes_where_nothing_is_learned():
    plain = subject_of_scheme(loop(), 1.0)
    assert smoothness_class(plain, BODIES).passed
    assert resolution_independence(plain, BODIES).passed
    assert limit_distance(plain, BODIES).passed


def test_turns_are_measured_to_the_last_degree():
    points, faces = icosphere(0)
    assert largest_turn(faces, points, points) == 0
    assert largest_turn(faces, points, points * [1, 1, -1]) > 100
    assert largest_turn(faces, points, np.full_like(points, np.nan)) == 180


def test_scale_free_schemes_are_certified_by_their_own_kind():
    theorems = [step.theorem for step in scheme_steps(subject(), (), 0, (3,))]
    assert theorems[-4:] == ["folds", "limit", "class", "scale"]
    assert scheme_steps(subject_of_scheme(loop(), 1.0), (), 0, (3,))[-1].theorem == "stars"
    assert isinstance(subject().scheme.edge_rule, ScaleFreeEdgeRule)
    assert subject().scheme.vertex_rule is not loop_vertex_rule
    assert scale_free_form(SCALE_FREE_CARD, 1.0).budget == 1.0


def kinked():
    """The rule with gates that open at once: its departure from Loop has a slope at flat stars."""
    sound = subject()
    edges, vertices = sound.scheme.edge_rule, sound.scheme.vertex_rule
    operator = replace(edges.operator, gate=lambda curvature: np.tanh(np.sqrt(curvature)))
    constant = replace(operator, network=lambda rows: np.tile([0.0, 1.0, 0.0], (len(rows), 1)))
    scheme = replace(sound.scheme, edge_rule=replace(edges, operator=constant))
    assert vertices is scheme.vertex_rule
    return subject_of_scheme(scheme, 20.0)


def test_a_gate_with_a_kink_is_found_at_the_wider_bounds_too():
    sharp = subject_of_scheme(pns(scale_free_model(0, 0.0)), 20.0)
    assert all(result.passed for result in planar_spectrum(sharp, (3, 6)))
    assert not all(result.passed for result in planar_spectrum(kinked(), (3, 6)))
