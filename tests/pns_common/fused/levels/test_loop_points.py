"""Loop's points by kernels, and the largest of their coordinates."""

import numpy as np
import pytest

from pns_common import Mesh, MeshError
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.levels.loop_points import (
    add_to,
    largest_size,
    loop_points,
    owners,
    place_vertices,
)
from pns_common.levels.refined_levels import check_coordinates
from pns_common.masks.stencils import loop_edge_vertices, loop_vertex_vertices
from tests.support.kernels import edges_built
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid, three_pages


@pytest.mark.parametrize(
    "shape", [bumpy_sphere(0), grid(5, bent), bow_tie(), three_pages()], ids=len
)
def test_points_have_the_bits_of_the_masks(shape):
    points, faces = shape
    topology, mesh = build_topology(faces, len(points)), edges_built(Mesh(points, faces))
    old, new = loop_vertex_vertices(points, topology), loop_edge_vertices(points, topology)
    for blocks in (Blocks(1), Blocks(2, rows=7)):
        placed = loop_points(points, mesh, blocks)
        assert placed.tobytes() == np.concatenate([old, new]).tobytes()
    moved = np.full_like(points, 9.0)
    place_vertices(points, mesh, Blocks(1), moved)
    assert moved.tobytes() == old.tobytes()


def test_sums_around_vertices_are_divided_among_threads_and_no_finer():
    assert owners(Blocks(3, rows=10), 1000).rows == 334
    assert owners(Blocks(3, rows=500), 1000).rows == 500
    assert owners(Blocks(3, rows=500, least=20), 1000).rows_of(1000) == 334


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.1e75])
def test_a_coordinate_out_of_range_is_found_in_any_block(bad):
    points = np.ones((100, 3))
    points[57, 2] = bad
    largest = largest_size(points, Blocks(2, rows=10))
    added = np.zeros((100, 3))
    added[[40, 77]] = [[3, 0, 4], [0, 12, 5]]
    moved, longest = add_to(points.copy() - added, added, 30, Blocks(2, rows=10))
    np.testing.assert_equal(moved, largest)
    assert longest == 13
    assert largest == abs(bad) or np.isnan(bad) == np.isnan(largest)
    with pytest.raises(MeshError, match="not numbers" if np.isnan(bad) else "too large"):
        check_coordinates(largest)
    check_coordinates(largest_size(np.full((3, 3), -1e75), Blocks(1)))
