"""Refined geometry is written with the narrowest indices that restart no primitive."""

import numpy as np
import pytest

from service.gltf.write.writer import as_indices


@pytest.mark.parametrize(("count", "width"), [(3, 2), (65535, 2), (65536, 4), (65537, 4)])
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_indices_are_narrow_while_none_is_the_largest_of_its_type(count, width, dtype):
    faces = np.array([[0, 1, count - 1]], dtype=dtype)
    written = as_indices(faces, count)
    assert (written.dtype.kind, written.dtype.itemsize) == ("u", width)
    assert written.tolist() == faces.tolist()
    assert written.max() < np.iinfo(written.dtype).max
