"""Morph targets that came sparse, as exporters write faces, go sparse: they move few vertices."""

import numpy as np
import pytest

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files, validator
from tests.support.meshes import bent, grid

POINTS, FACES = grid(12, bent)
CORNER = np.linalg.norm(POINTS - POINTS[0], axis=1) < 0.3
NAMES = ("POSITION", "NORMAL")


def shape(*moved):
    deltas = np.random.default_rng(0).normal(size=(len(moved), 2, len(POINTS), 3)) * 0.1
    targets = [
        dict(zip(NAMES, np.where(rows[:, None], two, 0), strict=True))
        for rows, two in zip(moved, deltas, strict=True)
    ]
    normals = np.tile([0.0, 0.0, 1.0], (len(POINTS), 1))
    return {"POSITION": POINTS, "NORMAL": normals, "indices": FACES, "targets": targets}


def made_sparse(tree, binary):
    """The same document, whose morph targets say where they move a vertex, and nothing else."""
    for number, target in enumerate(tree["meshes"][0]["primitives"][0]["targets"]):
        for name, index in target.items():
            values = files.values_of(tree, binary, index)
            rows = np.flatnonzero(values.any(axis=1))
            # What moves nothing says so of one vertex.
            rows = rows if len(rows) else np.array([0])
            places, content = (
                tree["accessors"][files.add_accessor(tree, binary, part)]
                for part in (rows[:, None].astype(np.uint16), values[rows])
            )
            accessor = tree["accessors"][index]
            del accessor["bufferView"]
            accessor["name"] = f"{name} {number}"
            accessor["sparse"] = {
                "count": len(rows),
                "indices": {"bufferView": places["bufferView"], "componentType": 5123},
                "values": {"bufferView": content["bufferView"]},
            }
    tree["buffers"] = [{"byteLength": len(binary)}]
    return tree, binary


def refined(tree, binary, **options):
    data = files.pack(tree, binary)
    return subdivide_gltf(data, "glb", Options(scheme="loop", **options), None, Limits())


@pytest.mark.parametrize("options", [{}, {"levels": 2}, {"normals": "smooth"}])
def test_they_move_the_same_vertices_by_the_same(options, tmp_path):
    given = shape(CORNER, ~CORNER, np.zeros_like(CORNER))
    dense = refined(*files.document([given]), **options)
    sparse = refined(*made_sparse(*files.document([given])), **options)
    for one, other in zip(*map(files.targets_of, (dense.glb, sparse.glb)), strict=True):
        for name in NAMES:
            np.testing.assert_array_equal(one[name], other[name])
    tree, _ = files.unpack(sparse.glb)
    targets = tree["meshes"][0]["primitives"][0]["targets"]
    kept = [[tree["accessors"][target[name]] for name in NAMES] for target in targets]
    assert [["sparse" in accessor for accessor in two] for two in kept] == [
        [True, True],
        [False, False],
        [False, False],
    ]
    assert [["bufferView" in accessor for accessor in two] for two in kept] == [
        [False, False],
        [True, True],
        [False, False],
    ]
    assert [two[0]["name"] for two in kept] == ["POSITION 0", "POSITION 1", "POSITION 2"]
    assert len(sparse.glb) < len(dense.glb)
    assert sparse.report["changes"] == dense.report["changes"]
    (tmp_path / "a.glb").write_bytes(sparse.glb)
    assert validator.errors([tmp_path / "a.glb"]) == [[]]
