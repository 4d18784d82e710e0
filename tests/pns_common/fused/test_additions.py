"""What a learned level adds: zeros to write into, views of parts, and a scale."""

import numpy as np

from pns_common import Mesh
from pns_common.base.blocks import BLOCK_ROWS, Blocks
from pns_common.fused.additions import Additions, Surroundings
from pns_common.models.contract import CALL_ROWS
from tests.support.kernels import edges_built
from tests.support.meshes import bumpy_sphere

MESH = Mesh(*bumpy_sphere(0, subdivisions=0))


def surroundings(length=2.0, blocks=None):
    nothing = np.zeros(12, dtype=bool)
    given = blocks or Blocks(1)
    return Surroundings(MESH.vertices, edges_built(MESH), nothing, length, given)


def test_parts_are_views_of_the_whole():
    added = Additions.nothing(5)
    added.part(slice(3, None)).displacement[:] = [1, 2, 3]
    added.part(slice(0, 2)).gate[:] = 0.5
    assert added.displacement.tolist() == [[0, 0, 0]] * 3 + [[1, 2, 3]] * 2
    assert added.gate.tolist() == [0.5, 0.5, 0, 0, 0]


def test_a_scale_is_of_the_displacement_and_of_its_share_of_the_bound_alone():
    added = Additions.nothing(2)
    for values in (added.displacement, added.ratio, added.gate, added.envelope):
        values[:] = 4.0
    added.scale(np.array([0.5, 0.0]))
    assert added.displacement.tolist() == [[2, 2, 2], [0, 0, 0]]
    assert added.ratio.tolist() == [2, 0]
    assert added.gate.tolist() == added.envelope.tolist() == [4, 4]


def test_a_budget_is_shared_out_by_one_length_or_by_each_vertexs():
    rows = np.array([0, 2])
    assert surroundings().budget_per_length(rows, 3.0).tolist() == [1.5, 1.5]
    lengths = np.arange(1.0, 13)
    assert surroundings(lengths).budget_per_length(rows, 3.0).tolist() == [3, 1]


def test_what_is_asked_for_twice_is_measured_once():
    seen = surroundings()
    assert seen.rings is seen.rings
    assert seen.pushes is seen.pushes
    assert seen.faces is seen.faces


def test_a_model_file_is_called_with_the_array_kernels_rows_whatever_the_threads():
    rows = surroundings(blocks=Blocks(4, rows=10**6, least=5)).network_blocks.rows_of(9000)
    assert rows % CALL_ROWS == BLOCK_ROWS % CALL_ROWS == 0
    assert surroundings(blocks=Blocks(1, rows=10**6)).network_blocks.rows_of(9000) == rows
    assert surroundings(blocks=Blocks(1, rows=7)).network_blocks.rows == 7
