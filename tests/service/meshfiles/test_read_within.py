"""Limits on reading a mesh file, and on positions of a glTF."""

from __future__ import annotations

import tracemalloc

import pytest

from service.bodies import media
from service.errors import LimitError, UnrefinableError
from service.meshfiles.convert import converted
from service.meshfiles.formats import memory_to_read, read_within
from service.meshfiles.triangulate import triangulated
from service.options import Limits, Options


@pytest.mark.parametrize("kind", sorted(set(media.KINDS) - set(media.GLTF_KINDS)))
def test_a_file_too_large_to_be_read_is_refused_before_it_is_read(kind: str) -> None:
    # It is no mesh at all: whoever read it would say so.
    most = memory_to_read(b"0" * 1000, kind) - 1
    with pytest.raises(LimitError) as refusal:
        read_within(b"0" * 1000, kind, Limits(max_memory_bytes=most))
    assert refusal.value.limit == "memory"


@pytest.mark.parametrize("far", ["9e38", "-1e300", "inf", "nan"])
def test_a_position_that_float32_cannot_hold_is_refused(far: str) -> None:
    data = f"v 0 0 {far}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode()
    with pytest.raises(UnrefinableError, match=r"float32|finite|infinite"):
        converted(data, "obj", "glb", Options(levels=1, scheme="loop"), None, Limits())


@pytest.mark.parametrize("shares", [(1.0, 0.0), (0.5, 0.5)])
def test_an_off_takes_no_more_than_is_predicted_whatever_its_lines_are(
    shares: tuple[float, float],
) -> None:
    """Of the shortest: all of vertices but one face, and as many faces as vertices."""
    vertices, faces = (max(int(share * 2**20) // 7, 1) for share in shares)
    data = b"OFF\n%d %d 0\n" % (vertices, faces) + b"0 0 0\n" * vertices + b"3 0 1 2\n" * faces
    tracemalloc.start()
    triangulated(read_within(data, "off", Limits()))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < memory_to_read(data, "off")
