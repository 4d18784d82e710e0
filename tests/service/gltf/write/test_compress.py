"""Compressed output: it decodes, by other paths than it was made, to what plain output holds."""

import DracoPy
import numpy as np
import pytest

from service.gltf.subdivide import subdivide_gltf
from service.gltf.write.compression import NORMAL_BITS, POSITION_BITS
from service.options import Limits, Options
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron

KINDS = ["draco", "meshopt"]
NAMES = {"draco": "KHR_draco_mesh_compression", "meshopt": "EXT_meshopt_compression"}


SAYS = {"draco": "compressed by Draco", "meshopt": "compressed by meshopt, exactly"}


def refine(data, compress="none", levels=2, normals="auto"):
    options = Options(levels=levels, scheme="loop", compress=compress, normals=normals)
    return subdivide_gltf(data, "glb", options, None, Limits())


def sample():
    """Two meshes of two materials, with every kind of attribute."""
    colours = np.random.default_rng(0).integers(0, 255, (24, 4), dtype=np.uint8)
    return files.glb(
        [box(COLOR_0=files.Normalized(colours)), octahedron()],
        [box(_ID=np.arange(24, dtype=np.uint16).reshape(-1, 1))],
    )


def triangles(data, mesh, primitive):
    """By attribute the values at all corners, in an order that numbering does not change."""
    faces, attributes = files.primitive_of(data, mesh, primitive)
    position = attributes["POSITION"][faces]
    key = np.round(position.reshape(len(faces), 9) * 64)
    key = np.sort(key.reshape(-1, 3, 3).sum(axis=2), axis=1)
    centre = np.round(position.mean(axis=1) * 256)
    order = np.lexsort((*key.T, *centre.T))
    return {name: values[faces][order] for name, values in attributes.items()}


def read_back(data):
    """The same file through the reader: level 1 of what it decodes to."""
    return refine(data, levels=1)


@pytest.mark.parametrize("compress", KINDS)
def test_compressed_output_is_smaller_and_declared(compress):
    plain, packed = refine(sample()), refine(sample(), compress)
    assert len(packed.glb) < len(plain.glb)
    tree, _ = files.unpack(packed.glb)
    assert tree["extensionsUsed"] == tree["extensionsRequired"] == [NAMES[compress]]
    whats = [change["what"] for change in packed.report["changes"]]
    assert any(what.startswith(SAYS[compress]) for what in whats)


@pytest.mark.parametrize("compress", ["none", *KINDS])
def test_the_report_counts_the_vertices_of_the_file(compress):
    # Draco joins what is alike: both sides of a hard edge inside a plane.
    square = {
        "POSITION": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]),
        "NORMAL": np.array([[0.0, 0, 1]] * 3 + [[0.01, 0, 1]] * 3),
        "indices": np.arange(6).reshape(-1, 3),
    }
    packed = refine(files.glb([square], [octahedron(), box()]), compress)
    tree, _ = files.unpack(packed.glb)
    written = [
        sum(
            tree["accessors"][each["attributes"]["POSITION"]]["count"]
            for each in mesh["primitives"]
        )
        for mesh in tree["meshes"]
    ]
    assert packed.report["totals"]["vertices"] == sum(written)


@pytest.mark.parametrize("compress", KINDS)
def test_refining_compressed_output_is_refining_plain_output(compress):
    plain, packed = (read_back(refine(sample(), kind).glb) for kind in ("none", compress))
    tree, _ = files.unpack(packed.glb)
    assert "extensionsUsed" not in tree
    exact = compress == "meshopt"
    for mesh, primitive in [(0, 0), (0, 1), (1, 0)]:
        wanted, unpacked = (triangles(r.glb, mesh, primitive) for r in (plain, packed))
        assert wanted.keys() == unpacked.keys()
        step = 2 / (2**POSITION_BITS - 1)
        np.testing.assert_allclose(
            np.sort(unpacked["POSITION"].reshape(-1, 3), axis=0),
            np.sort(wanted["POSITION"].reshape(-1, 3), axis=0),
            atol=1e-6 if exact else step,
        )
        for name in {"_ID", "COLOR_0"} & wanted.keys():
            assert unpacked[name].dtype == wanted[name].dtype


@pytest.mark.parametrize("compress", KINDS)
def test_a_strip_is_written_as_the_triangles_that_it_is(compress):
    strip = octahedron(indices=np.array([[0], [2], [4], [1], [3]]))
    tree, binary = files.document([strip])
    tree["meshes"][0]["primitives"][0]["mode"] = 5
    result = refine(files.pack(tree, binary), compress, levels=1).glb
    assert files.unpack(result)[0]["meshes"][0]["primitives"][0].get("mode", 4) == 4


def test_draco_rounds_no_more_than_it_says():
    # One level of nothing: the stored positions themselves, decoded by the reader.
    shape = box()
    packed = refine(files.glb([shape]), "draco", levels=1)
    plain = refine(files.glb([shape]), levels=1)
    stored = decoded(packed)
    _, attributes = files.primitive_of(plain.glb)
    extent = np.ptp(attributes["POSITION"], axis=0).max()
    nearest = np.abs(stored["POSITION"][:, None] - attributes["POSITION"]).max(axis=2).min(axis=1)
    assert nearest.max() <= 0.51 * extent / (2**POSITION_BITS - 1)
    lengths = np.linalg.norm(stored["NORMAL"], axis=1)
    np.testing.assert_allclose(lengths, 1, atol=2.0**-NORMAL_BITS)


def ball(size, origin=0.0):
    """An octahedron with the normals of the sphere around it."""
    shape = octahedron()
    return shape | {"POSITION": origin + size * shape["POSITION"], "NORMAL": shape["POSITION"]}


def decoded(result):
    """The values of each attribute of the first primitive, by Draco's own library."""
    tree, binary = files.unpack(result.glb)
    extension = tree["meshes"][0]["primitives"][0]["extensions"][NAMES["draco"]]
    view = tree["bufferViews"][extension["bufferView"]]
    mesh = DracoPy.decode(bytes(binary[view["byteOffset"] :][: view["byteLength"]]))
    parts = {part["unique_id"]: part["data"] for part in mesh.attributes}
    return {name: parts[number] for name, number in extension["attributes"].items()}


@pytest.mark.parametrize("origin", [0.0, 5.4321, 987.6])
def test_small_meshes_keep_positions_and_normals_under_draco(origin):
    # Draco hands on its grid as text of six decimals: beside a part of millimetres in metres that
    # is coarse.
    for size in np.geomspace(2e-5, 1.0, 30) if origin == 0 else np.geomspace(0.01, 1.0, 10):
        data = files.glb([ball(size, origin)])
        plain, stored = (
            files.primitive_of(refine(data).glb)[1],
            decoded(refine(data, "draco")),
        )
        distance = np.abs(stored["POSITION"][:, None] - plain["POSITION"]).max(axis=2)
        nearest = distance.argmin(axis=1)
        extent = np.ptp(plain["POSITION"], axis=0).max()
        limit = 0.51 * (extent + 4e-6) / (2**POSITION_BITS - 1) + np.spacing(np.float32(origin))
        assert distance.min(axis=1).max() <= limit
        np.testing.assert_allclose(
            stored["NORMAL"], plain["NORMAL"][nearest], atol=4 * 2.0**-NORMAL_BITS
        )


def test_meshes_too_small_for_dracos_grid_stay_uncompressed():
    data = files.glb([ball(1e-8)])
    packed = refine(data, "draco")
    faces, attributes = files.primitive_of(packed.glb)
    wanted_faces, wanted = files.primitive_of(refine(data).glb)
    np.testing.assert_array_equal(faces, wanted_faces)
    for name, values in wanted.items():
        np.testing.assert_array_equal(attributes[name], values)
    whats = [change["what"] for change in packed.report["changes"]]
    assert whats == ["not compressed: Draco cannot hold it"]


def test_a_vertex_of_too_many_faces_stays_uncompressed_under_draco(monkeypatch):
    """Of 40,000 faces around one edge Draco took seconds; it grows with their square."""

    def encode(*_, **__):
        pytest.fail("it is left to Draco")

    monkeypatch.setattr(DracoPy, "encode", encode)
    count = 40_000
    points = np.random.default_rng(0).normal(size=(count + 2, 3))
    faces = np.stack([np.zeros(count), np.ones(count), np.arange(2, count + 2)], axis=1).astype(int)
    fan = files.glb([{"POSITION": points, "indices": faces}])
    # New normals would part the fan.
    packed = refine(fan, "draco", levels=1, normals="keep")
    whats = [change["what"] for change in packed.report["changes"]]
    assert whats == ["not compressed: Draco cannot hold it"]


def test_seams_between_primitives_do_not_open_on_dracos_grid():
    # A sheet cut in two: the halves have different extents, and one grid.
    x, y = np.meshgrid(np.linspace(0, 1, 9) ** 2, np.linspace(0, 0.7, 5), indexing="ij")
    points = np.stack([x.reshape(-1), y.reshape(-1), np.sin(3 * x.reshape(-1))], axis=1)
    corner = (np.arange(8)[:, None] * 5 + np.arange(4)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, 5, 1]), np.add(corner, [1, 5, 6])])
    left = (faces < 20).any(axis=1)
    halves = [{"POSITION": points, "indices": faces[side]} for side in (left, ~left)]
    again = read_back(refine(files.glb(halves), "draco").glb)
    whole = read_back(refine(files.glb(halves)).glb)
    for report in (again.report, whole.report):
        assert report["levels"][0]["edges"]["irregular"] == 0
    assert again.report["levels"][0]["edges"] == whole.report["levels"][0]["edges"]


def test_morph_targets_stay_uncompressed_under_draco_and_are_named():
    tree, binary = files.document([octahedron()])
    target = files.add_accessor(tree, binary, np.ones((6, 3)))
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    result = refine(files.pack(tree, binary), "draco")
    after, _ = files.unpack(result.glb)
    assert "extensions" not in after["meshes"][0]["primitives"][0]
    assert "extensionsUsed" not in after
    assert {
        "pointer": "/meshes/0/primitives/0",
        "code": "not-draco",
        "what": "not compressed: Draco cannot hold it",
        "count": 1,
    } in result.report["changes"]


@pytest.mark.spawning
def test_validator_finds_no_error_in_compressed_output(tmp_path):
    paths = [tmp_path / f"{compress}.glb" for compress in KINDS]
    for path, compress in zip(paths, KINDS, strict=True):
        path.write_bytes(refine(sample(), compress).glb)
    assert validator.errors(paths) == [[], []]
