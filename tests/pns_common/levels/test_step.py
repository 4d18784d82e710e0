"""One level: both rules while they are learned, Loop afterwards, and the guard on what they add."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common.base.blocks import WHOLE
from pns_common.connectivity.topology import build_topology
from pns_common.errors import ParameterError
from pns_common.formula.fold_guard import FoldGuard
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level
from pns_common.rules.loop import loop_edge_rule, loop_vertex_rule
from pns_common.schemes import Scheme, loop
from tests.support.meshes import icosphere

POINTS, FACES = icosphere(0)
TOPOLOGY, COUNT = build_topology(FACES, 12), 12


def moved(rule, by):
    """Loop's placement and a fixed vector on all of it."""

    def added(level):
        base = rule(level)
        return replace(base, displacement=np.zeros_like(base.loop) + by, ratio=base.ratio + 0.5)

    return added


SCHEME = Scheme("by hand", moved(loop_vertex_rule, [0, 0, 1.0]), moved(loop_edge_rule, [0, 2.0, 0]))


def test_old_vertices_come_first_then_those_of_edges():
    level = control_level(POINTS, TOPOLOGY)
    step, base = level_step(level, SCHEME), level_step(level, loop())
    assert base.loop_points is None
    np.testing.assert_array_equal(step.loop_points, base.points)
    added = step.points - step.loop_points
    np.testing.assert_allclose(added[:COUNT], np.tile([0, 0, 1.0], (COUNT, 1)), atol=1e-15)
    np.testing.assert_allclose(added[COUNT:], np.tile([0, 2.0, 0], (30, 1)), atol=1e-15)
    assert (step.learned, step.guard, base.learned) == (True, None, False)


@pytest.mark.parametrize(("depth", "learned"), [(0, True), (1, True), (2, False)])
def test_after_the_learned_levels_it_is_loop(depth, learned):
    level = control_level(POINTS, TOPOLOGY, depth=depth)
    step = level_step(level, replace(SCHEME, learned_levels=2))
    assert step.learned is learned
    assert (step.loop_points is not None) is learned


@pytest.mark.parametrize(
    ("rules", "name", "found"),
    [
        ((loop_vertex_rule, lambda level: level.points), "edge_rule", "ndarray"),
        ((loop_edge_rule, loop_vertex_rule), "vertex_rule", "(30, 3)"),
        ((loop_vertex_rule, loop_vertex_rule), "edge_rule", "(12, 3)"),
    ],
    ids=["positions alone", "swapped", "of the other kind"],
)
def test_a_rule_that_places_no_vertices_or_others_is_refused_by_its_name(rules, name, found):
    with pytest.raises(ParameterError, match=name) as refusal:
        level_step(control_level(POINTS, TOPOLOGY), Scheme("by hand", *rules))
    assert found in str(refusal.value)


class Told(FoldGuard):
    """A guard that scales as it is told, and keeps what it was given."""

    scale = np.ones(COUNT + 30)
    given = None

    def __call__(self, faces, loop, displacement, blocks=WHOLE, first=None):
        Told.given = (len(faces), displacement, first)
        return self.scale


def test_a_guard_scales_what_is_added_and_its_share_of_the_bound(monkeypatch):
    scale = np.linspace(0, 1, COUNT + 30)
    monkeypatch.setattr(Told, "scale", scale)
    step = level_step(control_level(POINTS, TOPOLOGY), replace(SCHEME, guard=Told(1.0)))
    np.testing.assert_array_equal(step.guard, scale)
    np.testing.assert_array_equal(step.vertices.displacement[:, 2], scale[:COUNT])
    np.testing.assert_array_equal(step.edges.displacement[:, 1], 2 * scale[COUNT:])
    np.testing.assert_array_equal(step.edges.ratio, scale[COUNT:] / 2)


def test_of_a_rule_that_is_loops_the_guard_is_told_that_nothing_is_added():
    scheme = replace(SCHEME, vertex_rule=loop_vertex_rule, guard=Told(1.0))
    step = level_step(control_level(POINTS, TOPOLOGY), scheme)
    faces, displacement, first = Told.given
    assert (faces, first) == (4 * len(FACES), None)
    assert not displacement[:COUNT].any()
    assert displacement[COUNT:].any()
    assert step.vertices.displacement is None
    level_step(control_level(POINTS, TOPOLOGY), replace(scheme, moves_boundaries=True))
    assert not Told.given[2].any()  # a closed mesh has no boundary to settle first
