"""The tally of a step: of all of a mesh its report, of a part of it that part's."""

from itertools import islice

import numpy as np
import pytest

from pns_common import Mesh, pns, refine
from pns_common.base.blocks import Blocks
from pns_common.connectivity.creases import NO_CREASES
from pns_common.pieces.steps import steps_by_arrays, steps_by_kernels
from pns_common.pieces.tally import reduced_report
from pns_common.pieces.tally_of_step import tally_of
from tests.support.meshes import bent, grid
from tests.support.networks import scale_free_model, vertex_model

POINTS, FACES = grid(6, bent)
SCHEMES = {"guarded": pns(scale_free_model(0)), "flipping": pns(vertex_model(0, 30.0), 90.0)}


@pytest.mark.parametrize("steps", [steps_by_arrays, steps_by_kernels])
@pytest.mark.parametrize("name", SCHEMES)
def test_of_everything_it_is_the_report(name, steps):
    (step,) = islice(steps(POINTS, FACES, NO_CREASES, SCHEMES[name], 1.0, Blocks(1)), 1)
    everything = (np.ones(n, dtype=bool) for n in (len(FACES), len(step.points), 85))
    (level,) = reduced_report([[tally_of(step, *everything)]])["levels"]
    (expected,) = refine(Mesh(POINTS, FACES), SCHEMES[name], 1, 1.0).report["levels"]
    for key in ("faces", "edges", "degenerate_frames", "flipped_faces", "normal_jump_max", "shut"):
        assert level[key] == expected[key]
    assert level["displacement_max"] == expected["displacement_max"]
    assert level["gate"]["mean"] == pytest.approx(expected["gate"]["mean"], abs=1e-11)
    assert level["vertex_rule"]["vertices"] == expected["vertex_rule"]["vertices"]
    if name == "flipping":
        assert level["flipped_faces"] > 0


def test_what_is_not_the_pieces_own_does_not_count():
    (step,) = islice(
        steps_by_arrays(POINTS, FACES, NO_CREASES, SCHEMES["flipping"], 1.0, Blocks(1)), 1
    )
    own_faces = np.arange(len(FACES)) == 20
    own_edges = np.arange(85) == step.links.interior[7]
    own_vertices = np.zeros(len(step.points), dtype=bool)
    own_vertices[14] = own_vertices[36 + step.links.interior[7]] = True
    tally = tally_of(step, own_faces, own_vertices, own_edges)
    assert (tally.vertices, tally.faces, tally.edges) == (2, 4, (1, 0, 0, 0))
    row = step.links.interior[7]
    assert tally.ratio.largest == step.placed.edges.ratio[row]
    assert tally.vertex_gate.largest == step.placed.vertices.gate[14]
    added = step.placed.vertices.displacement[14], step.placed.edges.displacement[row]
    longest = max(np.linalg.norm(delta) for delta in added)
    assert tally.displacement == pytest.approx(longest, rel=1e-15)
