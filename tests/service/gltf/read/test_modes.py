"""Each mode makes as many triangles of its corners as the specification says, or is refused."""

import pytest

from service.errors import GltfError
from service.gltf.constants import FAN, STRIP, TRIANGLES
from service.gltf.read.plan import triangle_count


@pytest.mark.parametrize(
    ("corners", "mode", "count"), [(0, TRIANGLES, 0), (6, TRIANGLES, 2), (3, STRIP, 1), (6, FAN, 4)]
)
def test_triangles_are_counted(corners, mode, count):
    assert triangle_count(corners, mode, "") == count


@pytest.mark.parametrize(
    ("corners", "mode", "words"),
    [(4, TRIANGLES, "no whole triangles"), (2, STRIP, "no triangle"), (0, FAN, "no triangle")],
)
def test_corners_that_make_none_are_told(corners, mode, words):
    with pytest.raises(GltfError, match=words) as caught:
        triangle_count(corners, mode, "/here")
    assert caught.value.pointer == "/here"
