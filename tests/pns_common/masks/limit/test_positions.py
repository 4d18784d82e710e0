"""Where vertices end: masks that are convex, at corners and at the end of many steps."""

import numpy as np
import pytest

from pns_common.connectivity.creases import Creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.limit import limit_positions
from pns_common.masks.linear import level_topologies, refine_linear
from tests.support.meshes import bent, bow_tie, grid
from tests.support.stars import creased


def test_masks_are_convex():
    """Unit columns through the masks are the masks: no weight below 0, all sums 1."""
    points, faces = grid(5, bent)
    topology = creased(points, faces, 1)
    weights = limit_positions(np.eye(len(points)), topology)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-14)


def test_where_two_fans_meet_nothing_moves():
    points, faces = bow_tie()
    topology = build_topology(faces, len(points))
    np.testing.assert_array_equal(limit_positions(points, topology)[0], points[0])


@pytest.mark.parametrize("creases", [None, np.array([[7, 8], [8, 14], [14, 15]])])
def test_deep_refinement_arrives_there(creases):
    points, faces = grid(6, bent)
    topologies = level_topologies(faces, len(points), 6, Creases(creases))
    deep = refine_linear(points, topologies)
    limit = limit_positions(points, topologies[0])
    np.testing.assert_allclose(deep[: len(points)], limit, rtol=0, atol=2e-4)
