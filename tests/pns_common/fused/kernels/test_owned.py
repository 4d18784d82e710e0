"""Blocks of rows that lie elsewhere are passed by, and no other: sums are the same bits."""

from itertools import pairwise

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.fused.kernels.masks import sum_rings
from pns_common.fused.kernels.owned import PASSED_BY, block_end, is_elsewhere, owned_rows
from pns_common.fused.kernels.rings import (
    VERTEX_COLUMNS,
    mean_neighbours,
    mean_normals,
    mean_spokes,
)
from tests.support.kernels import edges_built
from tests.support.meshes import bent, grid

POINTS, FACES = grid(50, bent)
ORDER = np.random.default_rng(0).permutation(len(POINTS))
SHUFFLED = np.empty_like(POINTS)
SHUFFLED[ORDER] = POINTS
MESHES = {"as it lies": (POINTS, FACES), "at random": (SHUFFLED, ORDER[FACES])}


@pytest.fixture(params=MESHES)
def mesh(request):
    return Mesh(*MESHES[request.param])


@pytest.mark.parametrize("of", ["edges", "faces"])
def test_a_block_is_elsewhere_if_no_row_of_it_has_a_vertex_there(mesh, of):
    built = edges_built(mesh)
    rows, reach = {
        "edges": (built.edges, built.edge_reach),
        "faces": (built.faces, built.face_reach),
    }[of]
    assert len(reach) == -(-len(rows) // PASSED_BY) > 2
    for block in range(len(reach)):
        own = rows[PASSED_BY * block : block_end(rows, block)]
        assert reach[block].tolist() == [own.min(), own.max()]
        assert is_elsewhere(reach, block, 0, own.min())
        assert is_elsewhere(reach, block, own.max() + 1, len(POINTS))
        assert not is_elsewhere(reach, block, own.min(), own.min() + 1)
        assert not is_elsewhere(reach, block, own.max(), own.max() + 1)
        first = PASSED_BY * block
        assert owned_rows(rows, reach, block, 0, own.min()) == (first, 0)
        assert owned_rows(rows, reach, block, 0, len(POINTS)) == (first, len(own))
    assert block_end(rows, len(reach) - 1) == len(rows)


def around(mesh, bounds):
    """What is summed around vertices by owners of ranges, one after the other."""
    built, points, count = edges_built(mesh), mesh.vertices, len(mesh.vertices)
    rng = np.random.default_rng(1)
    of_edges, areas = rng.random((3, len(built.edges))), rng.random((len(built.faces), 4))
    fields, means, sums = (np.zeros((count, columns)) for columns in (4, VERTEX_COLUMNS, 3))
    valence, again = (np.zeros(count, dtype=np.int32) for _ in range(2))
    edges, faces = (built.edges, built.edge_reach), (built.faces, built.face_reach)
    ranges = list(pairwise(bounds))
    for begin, end in ranges:
        mean_normals(*faces, areas, begin, end, fields)
        mean_spokes(points, *edges, *of_edges, begin, end, means, valence)
        sum_rings(points, *edges, begin, end, sums, again)
    for begin, end in ranges:
        mean_neighbours(points, *edges, fields, valence, begin, end, means)
    return fields, means, sums, valence, again


def test_sums_have_the_bits_of_one_thread_for_any_owners(mesh):
    count = len(mesh.vertices)
    whole, owned = around(mesh, [0, count]), around(mesh, [0, 1, 700, 1900, count])
    for one, other in zip(whole, owned, strict=True):
        np.testing.assert_array_equal(one, other)
    assert whole[3].sum() == 2 * len(edges_built(mesh).edges)
