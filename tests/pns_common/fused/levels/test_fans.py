"""Fans around vertices, told apart by walking them."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.connectivity.topology import build_topology
from pns_common.fused.levels.fans import multi_fan_vertices
from tests.support.kernels import assert_kernels_agree, by_kernels, edges_built
from tests.support.meshes import bow_tie, icosphere, one_way_pair, three_pages


def cone(rim, apex=0, first=1):
    """Triangles that close around an apex."""
    ring = np.arange(first, first + rim)
    return np.stack([np.full(rim, apex), ring, np.roll(ring, -1)], axis=1)


@pytest.mark.parametrize("rims", [(3,), (3, 3), (3, 4), (6,), (5, 3, 3)])
@pytest.mark.parametrize("loose", [0, 1, 2])
def test_fans_that_close_around_one_vertex_are_told_apart(rims, loose):
    starts = 1 + np.cumsum([0, *rims])
    faces = [cone(rim, first=start) for rim, start in zip(rims, starts, strict=False)]
    # Triangles that hang on at the apex alone are fans too small to close.
    ends = starts[-1] + np.arange(2 * loose).reshape(loose, 2)
    # Before the others: a walk begins at a vertex's last corner.
    faces = np.concatenate([np.insert(ends, 0, 0, axis=1), *faces])
    points = np.random.default_rng(0).standard_normal((faces.max() + 1, 3))
    assert by_kernels(Mesh(points, faces), 1).multi_fan_vertices == (len(rims) + loose > 1)
    assert_kernels_agree(Mesh(points, faces), 2)


@pytest.mark.parametrize("shape", [bow_tie, three_pages, one_way_pair, icosphere])
def test_each_vertex_is_told_as_pointer_doubling_tells_it(shape):
    mesh = Mesh(*shape())
    expected = build_topology(mesh.faces, len(mesh.vertices)).multi_fan_vertices
    for rows in (3, 1000):
        marked = multi_fan_vertices(edges_built(mesh), Blocks(2, rows))
        np.testing.assert_array_equal(marked, expected)
