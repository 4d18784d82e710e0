"""The places that are renumbered are among those that are checked: one list of them, in effect."""

import pytest

from service.errors import GltfError, UnreadableError
from service.gltf.read.index_references import accessor_references, view_references
from tests.fuzz.seeds import draco, skinned, sparse
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files

BEYOND = 10**6


def places(tree):
    return [*accessor_references(tree), *view_references(tree, tree["accessors"])]


@pytest.mark.parametrize("made", [skinned, sparse, draco])
def test_every_place_that_is_renumbered_is_checked(made):
    count = len(places(made()[0]))
    assert count > 2
    for number in range(count):
        tree, binary = made()
        reference = places(tree)[number]
        reference.point_at(BEYOND)
        with pytest.raises((GltfError, UnreadableError), match=str(BEYOND)):
            refine(files.pack(tree, bytes(binary)))
