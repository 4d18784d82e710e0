"""Smooth fans are those of the arrays, whoever finds them."""

import numpy as np
import pytest

from pns_common.connectivity import smooth_fans as arrays
from pns_common.fused import load_kernels
from pns_common.fused.where_loaded import smooth_fans
from tests.support.meshes import face_lists

FACES = face_lists()


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("creased", [False, True])
@pytest.mark.parametrize("name", FACES)
def test_fans_have_the_numbers_of_the_arrays(name, creased, loaded, monkeypatch):
    if loaded:
        load_kernels()
    monkeypatch.setattr(smooth_fans, "kernels_loaded", lambda: loaded)
    faces = FACES[name]
    creases = faces[::3, :2] if creased else None
    given = faces, int(faces.max()) + 1, creases
    made, expected = smooth_fans.smooth_fans(*given), arrays.smooth_fans(*given)
    assert made.dtype == expected.dtype
    np.testing.assert_array_equal(made, expected)
