"""The unit of length of a mesh."""

import numpy as np
import pytest

from pns_common.geometry.reference_length import measure_reference_length
from tests.support.meshes import grid


def test_reference_length_is_one_on_the_papers_patch_and_follows_scale_only():
    vertices, faces = grid(9)
    assert measure_reference_length(vertices, faces) == pytest.approx(1, rel=1e-12)
    assert measure_reference_length(3 * vertices + 5, faces) == pytest.approx(3, rel=1e-12)
    unused = np.concatenate([vertices, [[100.0, 0, 0]]])
    assert measure_reference_length(unused, faces) == pytest.approx(1, rel=1e-12)
