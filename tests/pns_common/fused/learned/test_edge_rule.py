"""What kernels add at edges is what the rule adds, bit for bit, in any blocks."""

import numpy as np
import pytest

from pns_common import Mesh, pns
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.learned.edge_rule import add_at_edges
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.additions import Additions
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.rules.control_level import control_level
from tests.support.kernels import edges_built
from tests.support.meshes import bent, folded_sheet, grid
from tests.support.networks import random_model, scale_free_model, vertex_model

MESHES = {"bent": Mesh(*grid(5, bent)), "folded": Mesh(*folded_sheet(5))}
MODELS = {
    "format 1": random_model(0, scale=30.0),
    "format 2": vertex_model(0),
    "format 3": scale_free_model(0),
    "side gates": scale_free_model(0, side_gates=True, wide_bound=True),
}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("rows", [7, 10_000])
@pytest.mark.parametrize("shape", MESHES)
def test_kernels_add_what_the_rule_adds(name, rows, shape):
    points, mesh_faces = MESHES[shape].vertices, MESHES[shape].faces
    rule, edges = pns(MODELS[name]).edge_rule, edges_built(MESHES[shape])
    fans, blocks = np.zeros(len(points), dtype=bool), Blocks(2, rows)
    faces = FaceMeasures(points, edges.faces, blocks)
    added = Additions.unwritten(len(edges.edges))
    add_at_edges(rule, Surroundings(points, edges, faces, fans, 0.8, blocks), added)
    placed = rule(control_level(points, build_topology(mesh_faces, len(points)), 0.8))
    for part in ("displacement", "ratio", "gate", "envelope", "degenerate"):
        np.testing.assert_array_equal(getattr(added, part), getattr(placed, part), err_msg=part)
    assert added.displacement.any()
