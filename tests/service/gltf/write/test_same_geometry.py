"""Meshes that stand on the same accessors: copies of one in other materials."""

import numpy as np
import pytest

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron


def two_of_one(**more):
    """(tree, BIN): two meshes in two materials on the same accessors."""
    tree, binary = files.document([{**octahedron(), **more}])
    (mesh,) = tree["meshes"]
    tree["materials"] = [{"name": "red"}, {"name": "blue"}]
    tree["meshes"] = [
        {"primitives": [{**mesh["primitives"][0], "material": place}]} for place in (0, 1)
    ]
    tree["nodes"].append({"mesh": 1})
    return tree, binary


def refined(tree, binary, **options):
    data = files.pack(tree, binary)
    return subdivide_gltf(data, "glb", Options(scheme="loop", **options), None, Limits())


@pytest.mark.parametrize("compress", ["none", "meshopt", "draco"])
@pytest.mark.parametrize("levels", [1, 6])
def test_they_share_what_is_made_of_them(compress, levels):
    tree, binary = two_of_one()
    done = refined(tree, binary, compress=compress, levels=levels)
    after, _ = files.unpack(done.glb)
    one, other = (mesh["primitives"][0] for mesh in after["meshes"])
    assert (one.pop("material"), other.pop("material")) == (0, 1)
    assert one == other
    count = after["accessors"][one["attributes"]["POSITION"]]["count"]
    assert done.report["totals"]["vertices"] == 2 * count
    del tree["meshes"][1], tree["nodes"][1]
    tree["scenes"][0]["nodes"] = [0]
    alone = refined(tree, binary, compress=compress, levels=levels)
    assert len(done.glb) < len(alone.glb) + 2000


def test_meshes_that_differ_in_one_accessor_share_nothing():
    tree, binary = two_of_one()
    larger = 2 * octahedron()["POSITION"]
    other = files.add_accessor(tree, binary, larger)
    tree["buffers"] = [{"byteLength": len(binary)}]
    attributes = tree["meshes"][1]["primitives"][0]["attributes"]
    tree["meshes"][1]["primitives"][0]["attributes"] = {**attributes, "POSITION": other}
    glb = refined(tree, binary, levels=1).glb
    (_, small), (_, large) = (files.primitive_of(glb, mesh) for mesh in (0, 1))
    np.testing.assert_allclose(large["POSITION"], 2 * small["POSITION"], rtol=1e-6)
