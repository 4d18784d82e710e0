"""The cost of a file is known before it is paid; float32 and buffers end somewhere."""

import base64
import json
import re
import tracemalloc
from urllib.parse import quote

import numpy as np
import pytest

from service.errors import (
    GltfError,
    LimitError,
    NoModelError,
    UnrefinableError,
)
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.service.gltf.read.refused import refine
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.networks import random_model

LOUD = random_model(0, scale=30.0)


def test_predicted_faces_are_checked_at_the_limit():
    data = files.glb([octahedron()], [octahedron(), octahedron()])
    limits = Limits(max_faces=3 * 8 * 16)
    assert refine(data, levels=2, limits=limits).report["totals"]["faces"] == 384
    with pytest.raises(LimitError) as refusal:
        refine(data, levels=2, limits=Limits(max_faces=383))
    assert (refusal.value.limit, refusal.value.found) == ("faces", 384)
    assert refusal.value.status == 413


def test_predicted_memory_is_checked():
    with pytest.raises(LimitError) as refusal:
        refine(files.glb([octahedron()]), levels=6, limits=Limits(max_memory_bytes=2**20))
    assert refusal.value.limit == "memory"


@pytest.mark.parametrize("levels", [1, 3])
@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("skinned", [True, False])
def test_predicted_memory_bounds_what_is_used(levels, smooth, skinned):
    # Noise over a grid; smooth shares every vertex, the other has one for each corner.
    n = 64 // 2 ** (levels - 1)
    x, y = np.meshgrid(np.arange(float(n + 1)), np.arange(n + 1), indexing="ij")
    height = np.random.default_rng(0).random(x.size)
    points = np.stack([x.reshape(-1), y.reshape(-1), height], axis=1)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, n + 1, 1]), np.add(corner, [1, n + 1, n + 2])])
    if not smooth:
        points, faces = points[faces.reshape(-1)], np.arange(faces.size).reshape(-1, 3)
    shape = {
        "POSITION": points,
        "NORMAL": np.random.default_rng(1).standard_normal((len(points), 3)),
        "TEXCOORD_0": points[:, :2],
        "indices": faces,
    }
    if skinned:
        joints = np.random.default_rng(2).integers(0, 20, (len(points), 4))
        shape["JOINTS_0"] = joints.astype(np.uint8)
        shape["WEIGHTS_0"] = np.full((len(points), 4), 0.25, dtype=np.float32)
    data = files.glb([shape])
    refine(files.glb([octahedron()]), levels=levels)
    tracemalloc.start()
    try:
        refine(data, levels=levels, diagnostics="full")
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    with pytest.raises(LimitError) as refusal:
        refine(data, levels=levels, limits=Limits(max_memory_bytes=used))
    assert used < refusal.value.found < 5 * used


def test_many_primitives_over_one_large_accessor_count_as_they_cost():
    # 400 triangles that share 60,000 vertices: work in proportion to the triangles.
    points = np.random.default_rng(0).standard_normal((60_000, 3))
    tree, binary = files.document([{"POSITION": points, "indices": np.array([[0, 1, 2]])}])
    tree["meshes"][0]["primitives"] *= 400
    report = refine(files.pack(tree, binary), limits=Limits(max_memory_bytes=64 * 2**20)).report
    assert report["totals"]["faces"] == 1600


def test_positions_up_to_the_end_of_float32_are_refined():
    shape = octahedron()
    shape["POSITION"] = shape["POSITION"] * 3.4e38
    assert refine(files.glb([shape]), levels=2).report["totals"]["faces"] == 128


def test_positions_that_leave_float32_are_refused():
    shape = octahedron()
    shape["POSITION"] = shape["POSITION"] * 3e38
    with pytest.raises(UnrefinableError) as refusal:
        subdivide_gltf(
            files.glb([shape]), "glb", Options(budget=1e4, levels=2), random_model(0), Limits()
        )
    assert refusal.value.pointer == "/meshes/0"


def test_positions_that_leave_what_can_be_computed_with_are_refused():
    """An edge of 10³⁰ lets the next level move its vertex by 10⁶⁰ and more."""
    with pytest.raises(UnrefinableError, match="too large") as refusal:
        subdivide_gltf(
            files.glb([octahedron()]), "glb", Options(budget=1e30, levels=3), LOUD, Limits()
        )
    assert refusal.value.pointer == "/meshes/0"


def test_the_learned_scheme_needs_a_model():
    with pytest.raises(NoModelError):
        refine(files.glb([octahedron()]), scheme="pns")


def test_buffers_in_data_uris_are_read_and_joined():
    tree, binary = files.document([box()], [octahedron()])
    cut = tree["bufferViews"][5]["byteOffset"]
    parts = [bytes(binary[:cut]), bytes(binary[cut:])]
    for view in tree["bufferViews"][5:]:
        view["buffer"], view["byteOffset"] = 1, view["byteOffset"] - cut
    tree["buffers"] = [
        {
            "byteLength": len(part),
            "uri": "data:application/gltf-buffer;base64," + base64.b64encode(part).decode(),
        }
        for part in parts
    ]
    result = refine(json.dumps(tree).encode(), media="gltf")
    whole = refine(files.glb([box()], [octahedron()]))
    for mesh in (0, 1):
        faces, attributes = files.primitive_of(result.glb, mesh)
        expected_faces, expected = files.primitive_of(whole.glb, mesh)
        np.testing.assert_array_equal(faces, expected_faces)
        for name, values in expected.items():
            np.testing.assert_array_equal(attributes[name], values)
    after, _ = files.unpack(result.glb)
    assert len(after["buffers"]) == 1
    assert "uri" not in after["buffers"][0]
    assert result.report["changes"] == [
        {"pointer": "/buffers", "code": "buffers-joined", "what": "joined into one", "count": 2}
    ]


@pytest.mark.parametrize("case", [str, str.lower])
def test_a_data_uri_may_spell_its_letters_by_numbers(case):
    tree, binary = files.document([octahedron()])
    # What lies behind the buffer's length is not read.
    behind = b"\xfb\xef\xbe\xff" * 6
    spelt = quote(base64.b64encode(binary + behind[: 22 - len(binary) % 3]), safe="")
    assert {"%2B", "%2F", "%3D"} <= set(re.findall("%..", spelt))
    spelt = re.sub("%..", lambda found: case(found[0]), spelt)
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{spelt}"
    result = refine(json.dumps(tree).encode(), media="gltf")
    assert result.glb == refine(files.glb([octahedron()])).glb


@pytest.mark.parametrize("step", ["%", "%2B", "%41"])
def test_a_data_uri_of_numbers_takes_what_any_text_does(step):
    tree, _ = files.document([octahedron()])
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{step * 2**20}"
    body = json.dumps(tree).encode()
    tracemalloc.start()
    try:
        with pytest.raises(GltfError):
            refine(body, media="gltf")
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert used < 6 * len(body)
