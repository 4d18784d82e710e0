"""What is written once for meshes on the same accessors, sparse, and as narrow as may be."""

import numpy as np
import pytest

from service.gltf.write.writer import as_indices
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import octahedron
from tests.support.meshes import bent, grid


def refined(tree, binary, **options):
    return subdivide(data=files.pack(tree, binary), **options)


# Copies of one mesh in other materials


def two_of_one():
    """(tree, BIN): two meshes in two materials on the same accessors."""
    tree, binary = files.document([octahedron()])
    (mesh,) = tree["meshes"]
    tree["materials"] = [{"name": "red"}, {"name": "blue"}]
    tree["meshes"] = [
        {"primitives": [{**mesh["primitives"][0], "material": place}]} for place in (0, 1)
    ]
    tree["nodes"].append({"mesh": 1})
    return tree, binary


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
    other = files.add_accessor(tree, binary, 2 * octahedron()["POSITION"])
    tree["buffers"] = [{"byteLength": len(binary)}]
    primitive = tree["meshes"][1]["primitives"][0]
    primitive["attributes"] = primitive["attributes"] | {"POSITION": other}
    glb = refined(tree, binary).glb
    (_, small), (_, large) = (files.primitive_of(glb, mesh) for mesh in (0, 1))
    np.testing.assert_allclose(large["POSITION"], 2 * small["POSITION"], rtol=1e-6)


# Morph targets that came sparse, as exporters write faces, go sparse: they move few vertices

VERTICES, FACES = grid(12, bent)
CORNER = np.linalg.norm(VERTICES - VERTICES[0], axis=1) < 0.3
KINDS = ("POSITION", "NORMAL")


def shape(*moved):
    deltas = np.random.default_rng(0).normal(size=(len(moved), 2, len(VERTICES), 3)) * 0.1
    targets = [
        dict(zip(KINDS, np.where(rows[:, None], two, 0), strict=True))
        for rows, two in zip(moved, deltas, strict=True)
    ]
    normals = np.tile([0.0, 0.0, 1.0], (len(VERTICES), 1))
    return {"POSITION": VERTICES, "NORMAL": normals, "indices": FACES, "targets": targets}


def made_sparse(tree, binary):
    """The same document, whose morph targets say where they move a vertex, and nothing else."""
    for number, target in enumerate(tree["meshes"][0]["primitives"][0]["targets"]):
        for name, index in target.items():
            values = files.values_of(tree, binary, index)
            rows = np.flatnonzero(values.any(axis=1))
            # What moves nothing says so of one vertex.
            rows = rows if len(rows) else np.array([0])
            places, content = (
                tree["accessors"][files.add_accessor(tree, binary, part)]["bufferView"]
                for part in (rows[:, None].astype(np.uint16), values[rows])
            )
            accessor = tree["accessors"][index]
            del accessor["bufferView"]
            accessor["name"] = f"{name} {number}"
            indices = {"bufferView": places, "componentType": 5123}
            values = {"bufferView": content}
            accessor["sparse"] = {"count": len(rows), "indices": indices, "values": values}
    tree["buffers"] = [{"byteLength": len(binary)}]
    return tree, binary


@pytest.mark.parametrize("options", [{}, {"levels": 2}, {"normals": "smooth"}])
def test_sparse_targets_move_the_same_vertices_by_the_same(options, tmp_path):
    given = shape(CORNER, ~CORNER, np.zeros_like(CORNER))
    dense = refined(*files.document([given]), **options)
    sparse = refined(*made_sparse(*files.document([given])), **options)
    for one, other in zip(*map(files.targets_of, (dense.glb, sparse.glb)), strict=True):
        np.testing.assert_equal(one, other)
    tree, _ = files.unpack(sparse.glb)
    targets = tree["meshes"][0]["primitives"][0]["targets"]
    kept = [[tree["accessors"][target[name]] for name in KINDS] for target in targets]
    stored = [[set(each) & {"sparse", "bufferView"} for each in two] for two in kept]
    assert stored == [[{"sparse"}] * 2, [{"bufferView"}] * 2, [set()] * 2]
    assert [two[0]["name"] for two in kept] == ["POSITION 0", "POSITION 1", "POSITION 2"]
    assert len(sparse.glb) < len(dense.glb)
    assert sparse.report["changes"] == dense.report["changes"]
    (tmp_path / "a.glb").write_bytes(sparse.glb)
    assert validator.errors([tmp_path / "a.glb"]) == [[]]


# Indices


@pytest.mark.parametrize(("count", "width"), [(3, 2), (65535, 2), (65536, 4), (65537, 4)])
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_indices_are_narrow_while_none_is_the_largest_of_its_type(count, width, dtype):
    """Which would restart a primitive."""
    faces = np.array([[0, 1, count - 1]], dtype=dtype)
    written = as_indices(faces, count)
    assert (written.dtype.kind, written.dtype.itemsize) == ("u", width)
    assert written.tolist() == faces.tolist()
    assert written.max() < np.iinfo(written.dtype).max
