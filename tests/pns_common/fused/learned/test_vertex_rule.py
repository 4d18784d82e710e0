"""What kernels add at old vertices is what the rule adds, bit for bit, in any blocks."""

import numpy as np
import pytest

from pns_common import Mesh, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.learned.vertex_rule import add_at_vertices
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.rules.control_level import control_level
from tests.support.kernels import edges_built
from tests.support.meshes import bent, grid
from tests.support.networks import scale_free_model, vertex_model

MESH = Mesh(*grid(5, bent))
LEVEL = control_level(MESH.vertices, build_topology(MESH.faces, 25), 0.8)


def surroundings(fans, blocks, altitudes=np.inf):
    mesh = edges_built(MESH)
    faces = FaceMeasures(MESH.vertices, mesh.faces, blocks)
    return Surroundings(MESH.vertices, mesh, faces, fans, 0.8, blocks, altitudes=altitudes)


@pytest.mark.parametrize(
    ("model", "altitudes"),
    [
        (vertex_model(0), np.inf),
        (scale_free_model(0), np.inf),
        (scale_free_model(0, network_altitudes=0.7), 0.7),
    ],
)
@pytest.mark.parametrize("rows", [4, 10_000])
def test_kernels_add_what_the_rule_adds(model, altitudes, rows):
    rule, fans = pns(model).vertex_rule, np.zeros(25, dtype=bool)
    seen = surroundings(fans, Blocks(2, rows), altitudes)
    added = Additions.unwritten(25)
    add_at_vertices(rule, seen, added)
    placed = rule(LEVEL)
    for part in ("displacement", "ratio", "gate", "envelope"):
        np.testing.assert_array_equal(getattr(added, part), getattr(placed, part), err_msg=part)
    assert np.flatnonzero(added.gate).tolist() == np.flatnonzero(placed.corrected).tolist()


def test_vertices_of_several_fans_are_left_alone():
    rule, fans = pns(vertex_model(0)).vertex_rule, np.arange(25) == 12
    added = Additions.unwritten(25)
    add_at_vertices(rule, surroundings(fans, Blocks(1)), added)
    assert not added.displacement[12].any()
    assert added.displacement[[6, 7, 8, 11, 13]].any(axis=1).all()
