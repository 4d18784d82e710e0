"""A learned step: refused where a network says nonsense, guarded where faces would fold."""

import weakref
from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, ModelError, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES
from pns_common.connectivity.topology import build_topology
from pns_common.fused.learned.learned_step import learned_points
from pns_common.fused.levels.level import control_level
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level as array_level
from tests.support.kernels import assert_kernels_agree, by_kernels
from tests.support.meshes import bumpy_sphere
from tests.support.networks import SCALE_FREE_CARD, VERTEX_CARD, scale_free_model, vertex_model
from tests.support.stand_in_models import Constant


def test_the_guard_takes_rounds_and_both_ways_take_the_same():
    mesh = Mesh(*bumpy_sphere(3, bump=0.5))
    scheme = pns(scale_free_model(fold_angle=2.0))
    made, free = by_kernels(mesh, 1, scheme=scheme), replace(scheme, guard=None)
    assert not np.array_equal(made.points, by_kernels(mesh, 1, scheme=free).points)
    assert_kernels_agree(mesh, 1, scheme=scheme)


@pytest.mark.parametrize("card", [VERTEX_CARD, SCALE_FREE_CARD])
@pytest.mark.parametrize(("edges", "vertices"), [(np.nan, 0.0), (0.0, np.inf)])
def test_what_a_network_may_not_return_is_refused(card, edges, vertices):
    with pytest.raises(ModelError, match="finite"):
        by_kernels(Mesh(*bumpy_sphere(0)), 1, scheme=pns(Constant(card, edges, vertices)))


def test_what_it_asked_of_faces_goes_with_the_rules():
    points, faces = bumpy_sphere(1, subdivisions=0)
    level = control_level(points, faces, NO_CREASES, Blocks(1))
    normals = weakref.ref(level.faces.normals)
    learned_points(level, pns(scale_free_model(0)), 0.7, Blocks(1))
    assert normals() is None


@pytest.mark.parametrize("model", [scale_free_model(0), vertex_model(0)])
def test_a_step_is_the_array_kernels_and_only_without_a_guard_can_faces_be_flipped(model):
    points, faces = bumpy_sphere(1, subdivisions=0)
    scheme = pns(model)
    level = control_level(points, faces, NO_CREASES, Blocks(1))
    made = learned_points(level, scheme, 0.7, Blocks(1))
    step = level_step(array_level(points, build_topology(faces, 12), 0.7), scheme)
    np.testing.assert_array_equal(made.points, step.points)
    np.testing.assert_array_equal(made.added.displacement[:12], step.vertices.displacement)
    assert (made.counterpart is None) == (scheme.guard is not None)
    if made.counterpart is not None:
        np.testing.assert_array_equal(made.counterpart, step.loop_points)
    of_each = learned_points(level, scheme, np.full(12, 0.7), Blocks(1))
    np.testing.assert_array_equal(of_each.points, made.points)
