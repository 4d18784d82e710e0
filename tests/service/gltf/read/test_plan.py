"""The prediction of memory leaves nothing out."""

import json
import tracemalloc
from base64 import b64encode

import numpy as np
import pytest

from service.errors import LimitError
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron
from tests.support.meshes import bumpy_sphere

LOOP = Options(scheme="loop")


def refuse_what_it_takes(data, media, options):
    """Refine a file without limits, then within the memory that it took: the prediction is more."""
    # Kernels are loaded with the first that needs them.
    subdivide_gltf(data, media, options, None, Limits())
    tracemalloc.start()
    try:
        subdivide_gltf(data, media, options, None, Limits())
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    with pytest.raises(LimitError) as refusal:
        subdivide_gltf(data, media, options, None, Limits(max_memory_bytes=used))
    assert refusal.value.limit == "memory"


def with_image(size):
    """Eight faces, and an image that is copied through."""
    tree, binary = files.document([octahedron()])
    start = len(binary) + -len(binary) % 4
    binary = bytes(binary).ljust(start, b"\0") + bytes(size)
    tree["buffers"][0]["byteLength"] = len(binary)
    tree["images"] = [{"bufferView": len(tree["bufferViews"]), "mimeType": "image/png"}]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": size})
    return files.pack(tree, binary)


def test_an_uploads_own_bytes_are_predicted():
    data = with_image(16 * 2**20)
    tracemalloc.start()
    try:
        subdivide_gltf(data, "glb", LOOP, None, Limits())
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert used >= len(data)
    # The upload itself was there before.
    with pytest.raises(LimitError) as refusal:
        subdivide_gltf(data, "glb", LOOP, None, Limits(max_memory_bytes=used + len(data) - 1))
    assert refusal.value.limit == "memory"


def test_the_limit_is_predicted_where_every_edge_is_a_crease():
    vertices, faces = bumpy_sphere(subdivisions=3)
    data = files.glb([{"POSITION": vertices, "indices": faces}])
    options = Options(scheme="loop", crease="angle:0", limit=True)
    refuse_what_it_takes(data, "glb", options)


@pytest.mark.parametrize("letter", ["\u00e9", "\u20ac", "\U0001f600", r"\ud83d\ude00"])
@pytest.mark.parametrize("place", ["name", "uri"])
def test_a_letter_that_makes_all_of_its_string_wide_is_predicted(letter, place):
    tree, binary = files.document([octahedron()])
    tree["buffers"][0]["uri"] = f"data:;base64,{b64encode(binary).decode()}"
    tree["images"] = [{place: "@"}]
    data = json.dumps(tree).encode().replace(b"@", b"a" * 2**21 + letter.encode())
    refuse_what_it_takes(data, "gltf", LOOP)


def test_what_is_narrow_is_predicted_as_wide_as_it_is_written():
    vertices, faces = bumpy_sphere(subdivisions=2)
    corners = vertices[faces].reshape(-1, 3)
    narrow = {f"_A{n}": np.ones((len(corners), 1), np.uint8) for n in range(100)}
    data = files.glb([{"POSITION": corners, **narrow}])
    refuse_what_it_takes(data, "glb", LOOP)


@pytest.mark.parametrize("whose", ["its own", "another's", "another's joints"])
def test_what_moves_a_mesh_is_predicted_where_it_moves_nothing(whose):
    """Targets without positions, and what one primitive has and others have not, are zeros."""
    vertices, faces = bumpy_sphere(subdivisions=2)
    large = {"POSITION": vertices, "indices": faces}
    small = octahedron(POSITION=4 + octahedron()["POSITION"])
    if whose == "its own":
        large["targets"] = [{}] * 200
    elif whose == "another's":
        small["targets"] = [{"POSITION": small["POSITION"]}] * 200
    else:
        joints, weights = np.zeros((6, 4), np.uint8), np.tile(np.float32([1, 0, 0, 0]), (6, 1))
        small |= {f"JOINTS_{n}": joints for n in range(30)}
        small |= {f"WEIGHTS_{n}": weights for n in range(30)}
    tree, binary = files.document([large, small])
    tree["nodes"], tree["skins"] = [{"mesh": 0, "skin": 0}, {}], [{"joints": [1]}]
    data = files.pack(tree, binary)
    refuse_what_it_takes(data, "glb", LOOP)


@pytest.mark.parametrize("what", ["name", "extras"])
@pytest.mark.parametrize("whose", ["primitives", "targets"])
def test_what_a_shared_accessor_says_is_predicted_as_often_as_it_is_written(what, whose):
    tree, binary = files.document([octahedron()])
    tree["accessors"][0][what] = "a" * 2**17
    (mesh,) = tree["meshes"]
    if whose == "primitives":
        mesh["primitives"] *= 100
    else:
        mesh["primitives"][0]["targets"] = [{"POSITION": 0}] * 100
    refuse_what_it_takes(files.pack(tree, binary), "glb", LOOP)
