"""A mesh file on its way to glTF: what it may cost."""

from __future__ import annotations

import pytest

from service.bodies.uploads import Sent
from service.errors import LimitError
from service.meshfiles.example import part_glb
from service.meshfiles.to_gltf import BYTES_PER_BYTE, as_gltf
from service.options import Limits, Options


def test_a_gltf_passes_as_it_is() -> None:
    sent = Sent(part_glb(), "glb")
    assert as_gltf(sent, Options(), Limits()) is sent


@pytest.mark.parametrize("kind", sorted(BYTES_PER_BYTE))
def test_a_file_too_large_to_be_read_is_refused_before_it_is_read(kind: str) -> None:
    # It is no mesh at all: whoever read it would say so.
    sent = Sent(b"0" * 1000, kind)
    with pytest.raises(LimitError) as refusal:
        as_gltf(sent, Options(), Limits(max_memory_bytes=1000 * BYTES_PER_BYTE[kind] - 1))
    assert refusal.value.limit == "memory"
