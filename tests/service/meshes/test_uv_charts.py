"""Creases of charts, by the names that the mesh has for them."""

import numpy as np
import pytest

from pns_common import Creases
from service.meshes.barycentric_grid import barycentric_grid
from service.meshes.split_connectivity import split_connectivity
from service.meshes.uv_charts import smooth_uv


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_creases_are_found_whatever_the_type_and_size_of_their_names(dtype):
    # A fan of four faces around corner 0; vertices are numbered beyond √2³¹, the largest elsewhere.
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
    vertex, uv = 50_000 + np.arange(5), np.random.default_rng(0).random((5, 2))
    named = np.array([[50_000, 50_001], [50_003, 50_000], [60_000, 60_001]], dtype=dtype)
    own = split_connectivity(faces, 5, barycentric_grid(1))
    smooth = smooth_uv(own, vertex, uv, Creases())
    sharp = smooth_uv(own, vertex, uv, Creases(named))
    # On a crease a vertex follows its two neighbours along it: 3/4, and 1/8 of each.
    np.testing.assert_allclose(sharp[0], 3 / 4 * uv[0] + (uv[1] + uv[3]) / 8, atol=1e-15)
    assert np.abs(smooth[0] - sharp[0]).max() > 1e-3
