"""The prior beside the kernels has the rule's bits: rings, curves and tips, in any blocks."""

import numpy as np
import pytest

from pns_common import Mesh, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.learned.curves import curves_of
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.learned.vertex_prior import priors_at
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.rules.control_level import control_level
from tests.support.kernels import edges_built
from tests.support.meshes import grid
from tests.support.networks import scale_free_model

COUNT = 49
# Alone and unbounded, with its gates open: what a vertex gets is its prior.
OPEN = {"budget": 1e9, "vertex_gate_sharpness": 1e9, "fold_angle": 89.999}


@pytest.mark.parametrize("tip_strength", [None, 0.8])
@pytest.mark.parametrize("boundary_strength", [None, 1.0])
@pytest.mark.parametrize("rows", [4, 10_000])
def test_it_is_what_the_rule_moves_a_vertex_by(tip_strength, boundary_strength, rows):
    points, faces = grid(7)
    points[:, 2] += np.random.default_rng(0).uniform(0, 0.3, COUNT)
    mesh = Mesh(points, faces)
    strengths = {"tip_strength": tip_strength, "boundary_strength": boundary_strength}
    scheme = pns(scale_free_model(scale=0, **strengths, **OPEN))
    rule, edges, blocks = scheme.vertex_rule, edges_built(mesh), Blocks(2, rows)
    curves = curves_of(rule.curves, points, edges, 1.0, blocks)
    at_faces, fans = FaceMeasures(points, edges.faces, blocks), np.zeros(COUNT, dtype=bool)
    level = Surroundings(points, edges, at_faces, fans, 1.0, blocks, curves)
    inside = np.flatnonzero(level.rings.smooth).astype(np.int32)
    prior = priors_at(inside, rule.form, level)
    placed = rule(control_level(points, build_topology(faces, COUNT)))
    assert (placed.gate[inside] == 1).all()
    np.testing.assert_array_equal(prior[inside], placed.displacement[inside])
