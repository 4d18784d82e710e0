"""What both rules add to a level, on all of it or where it bends, is what the array kernels add."""

import numpy as np
import pytest

from pns_common import Mesh, load_model, loop, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES
from pns_common.connectivity.topology import build_topology
from pns_common.fused.learned import bent_part
from pns_common.fused.learned.added_by_rules import added_by_rules, curve_rule
from pns_common.fused.learned.curves import curves_of
from pns_common.fused.levels.level import control_level
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level as array_level
from tests.support.meshes import grid
from tests.support.networks import scale_free_model

SCHEME = pns(load_model())


def pit(n=14):
    return Mesh(*grid(n, lambda x, y: -0.2 * np.maximum(0.3 - x**2 - y**2, 0)))


def added(mesh, scheme=SCHEME):
    level = control_level(mesh.vertices, mesh.faces, NO_CREASES, Blocks(1))
    curves = curves_of(curve_rule(scheme), mesh.vertices, level.mesh, 0.7, Blocks(1))
    return added_by_rules(level, scheme, 0.7, Blocks(1), curves), curves


@pytest.mark.parametrize("cut", [False, True])
def test_it_is_what_the_array_kernels_add_but_on_curves(cut, monkeypatch):
    mesh, count = pit(), len(pit().vertices)
    if cut:
        monkeypatch.setattr(bent_part, "LEAST_FACES", 0)
        monkeypatch.setattr(bent_part, "LARGEST_PART", 1.0)
    made, curves = added(mesh)
    topology = build_topology(mesh.faces, count)
    step = level_step(array_level(mesh.vertices, topology, 0.7), SCHEME)
    assert np.array_equal(step.guard, np.ones(len(step.guard)))
    inside = np.ones(count + len(topology.edges), dtype=bool)
    inside[curves.level.rows] = inside[count + curves.level.mesh.sharp_edges] = False
    expected = np.concatenate([step.vertices.displacement, step.edges.displacement])
    np.testing.assert_array_equal(made.both.displacement[inside], expected[inside])
    assert expected[inside].any()
    for name in ("ratio", "gate", "envelope", "degenerate"):
        of_both = [getattr(of, name) for of in (step.vertices, step.edges)]
        np.testing.assert_array_equal(getattr(made.both, name)[inside], np.r_[*of_both][inside])
    if cut:
        np.testing.assert_array_equal(made.moved, made.both.displacement.any(axis=1))
        assert not made.moved_with(curves)[inside][~expected[inside].any(axis=1)].any()
        assert made.moved_with(curves)[~inside].all()
    else:
        assert len(made.moved) == len(made.moved_with(curves)) == 0


def test_rules_of_curves_are_those_of_boundaries():
    assert curve_rule(SCHEME) is not None
    assert curve_rule(loop()) is curve_rule(pns(scale_free_model())) is None
