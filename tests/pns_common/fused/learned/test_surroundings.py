"""What a learned level reads of its mesh: each part once, networks' rows alike for all threads."""

import numpy as np

from pns_common import Mesh
from pns_common.base.blocks import BLOCK_ROWS, Blocks
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.face_measures import FaceMeasures
from tests.support.kernels import edges_built
from tests.support.meshes import bumpy_sphere

MESH = Mesh(*bumpy_sphere(0, subdivisions=0))


def surroundings(length=2.0, blocks=None):
    mesh, nothing = edges_built(MESH), np.zeros(12, dtype=bool)
    given = blocks or Blocks(1)
    faces = FaceMeasures(MESH.vertices, mesh.faces, given)
    return Surroundings(MESH.vertices, mesh, faces, nothing, length, given)


def test_a_budget_is_shared_out_by_one_length_or_by_each_vertexs():
    rows = np.array([0, 2])
    assert surroundings().budget_per_length(rows, 3.0).tolist() == [1.5, 1.5]
    lengths = np.arange(1.0, 13)
    assert surroundings(lengths).budget_per_length(rows, 3.0).tolist() == [3, 1]


def test_what_is_asked_for_twice_is_measured_once():
    seen = surroundings()
    assert seen.rings is seen.rings
    assert seen.pushes is seen.pushes


def test_what_edges_read_outlives_the_rings():
    whole, seen = surroundings(), surroundings()
    seen.forget_rings()
    assert "rings" not in vars(seen)
    assert seen.faces.areas.any()
    assert seen.rings.means.any()
    assert not seen.faces.holds_areas
    seen.forget_rings()
    assert len(seen.rings.means) == 0
    for part in ("fields", "smooth"):
        np.testing.assert_array_equal(getattr(seen.rings, part), getattr(whole.rings, part))
    for part in ("lengths", "network_lengths", "jumps"):
        np.testing.assert_array_equal(getattr(seen.edges, part), getattr(whole.edges, part))
    assert len(seen.edges.bends) == 0
    np.testing.assert_array_equal(seen.pushes, whole.pushes)
    np.testing.assert_array_equal(seen.bends, whole.bends)
    assert len(seen.edges.jumps) == 0
    np.testing.assert_array_equal(seen.logs, np.log(seen.edges.lengths))
    np.testing.assert_array_equal(seen.faces.normals, whole.faces.normals)


def test_networks_see_rows_in_the_array_kernels_blocks_whatever_the_threads():
    for threads in (1, 4):
        blocks = surroundings(blocks=Blocks(threads, rows=10**6, least=5)).network_blocks
        assert blocks.rows_of(9000) == Blocks(1, BLOCK_ROWS).rows_of(9000)
    assert surroundings(blocks=Blocks(1, rows=7)).network_blocks.rows == 7
