"""Simplifiers: near their target, near the surface; what is no fair coarse mesh is left out."""

import numpy as np
import pytest

from pns_common.errors import MeshError
from pns_common.mesh import Mesh
from train.data.primitives import icosphere
from train.data.simplifiers import SIMPLIFIERS, clustered, fast_quadric, simplified

SPHERE = icosphere(4)


@pytest.mark.parametrize("name", SIMPLIFIERS)
@pytest.mark.parametrize("faces", [100, 500])
def test_comes_near_the_target_and_stays_on_the_sphere(name, faces):
    coarse = simplified(SPHERE, SIMPLIFIERS[name], faces)
    assert coarse is not None
    assert faces / 1.6 <= len(coarse.faces) <= 1.6 * faces
    radius = np.linalg.norm(coarse.vertices, axis=1)
    assert np.abs(radius - 1).max() < 0.15


@pytest.mark.parametrize("name", SIMPLIFIERS)
def test_is_deterministic(name):
    coarse, again = (SIMPLIFIERS[name](SPHERE, 200) for _ in range(2))
    np.testing.assert_array_equal(coarse.vertices, again.vertices)
    np.testing.assert_array_equal(coarse.faces, again.faces)


def test_is_left_out_where_the_target_is_missed_or_little_hangs_together():
    assert simplified(SPHERE, lambda mesh, _: mesh, 100) is None
    many = [np.add(SPHERE.vertices, [3.0 * k, 0, 0]) for k in range(3)]
    count = len(SPHERE.vertices)
    parts = Mesh(np.concatenate(many), np.concatenate([SPHERE.faces + count * k for k in range(3)]))
    assert simplified(parts, fast_quadric, 600) is None


def test_clustering_that_leaves_nothing_is_left_out():
    """Two specks far apart: whatever the grid, each of them lies in two cells at the most."""
    speck = 1e-6 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    specks = Mesh(np.concatenate([speck, [1, 0, 0] - speck]), np.arange(6).reshape(2, 3))
    with pytest.raises(MeshError, match="leaves nothing"):
        clustered(specks, 5)
    assert simplified(specks, clustered, 5) is None
