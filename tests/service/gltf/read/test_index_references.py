"""The places that are renumbered are among those that are checked: one list of them, in effect."""

import pytest

from service.errors import GltfError, UnreadableError
from service.gltf.read.extensions import (
    accessor_references,
    unknown_extensions,
    view_references,
)
from tests.fuzz.seeds import draco, skinned, sparse
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files

BEYOND = 10**6


def places(tree):
    references = [*accessor_references(tree), *view_references(tree, tree["accessors"])]
    return [(holder, key) for holders, key in references for holder in holders if key in holder]


@pytest.mark.parametrize("made", [skinned, sparse, draco])
def test_every_place_that_is_renumbered_is_checked(made):
    count = len(places(made()[0]))
    assert count > 2
    for number in range(count):
        tree, binary = made()
        holder, key = places(tree)[number]
        holder[key] = BEYOND
        with pytest.raises((GltfError, UnreadableError), match=str(BEYOND)):
            refine(files.pack(tree, bytes(binary)))


@pytest.mark.parametrize(
    "name",
    [
        "EXT_mesh_features",
        "KHR_gaussian_splatting",
        "KHR_physics_rigid_bodies",
        "MSFT_texture_dds",
        "VRMC_materials_hdr_emissiveMultiplier",
        "VRMC_springBone_extended_collider",
    ],
)
def test_what_is_handled_is_known(name):
    # They name images, textures, nodes and attributes: no accessor and no buffer view.
    assert unknown_extensions({"extensionsUsed": [name]}, b"") == []


def test_an_extension_for_each_of_many_parts():
    # To copy the names so far for each part takes most of a minute.
    names = [f"EXT_{number:06d}" for number in range(50_000)]
    tree = {"materials": [{"extensions": {name: {}}} for name in names]}
    assert unknown_extensions(tree, b'"extensions"') == names
