"""Compressed output: it decodes, by other paths than it was made, to what plain output holds."""

import DracoPy
import numpy as np
import pytest

from service.gltf.write.compression import NORMAL_BITS, POSITION_BITS
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron

NAMES = {"draco": "KHR_draco_mesh_compression", "meshopt": "EXT_meshopt_compression"}
SAYS = {"draco": "compressed by Draco", "meshopt": "compressed by meshopt, exactly"}
STEP = 1 / (2**POSITION_BITS - 1)
UNHELD = "not compressed: Draco cannot hold it"


def refine(data, compress="none", levels=2, **options):
    return subdivide(data=data, compress=compress, levels=levels, **options)


def whats(result):
    return [change["what"] for change in result.report["changes"]]


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


def decoded(result):
    """The values of each attribute of the first primitive, by Draco's own library."""
    tree, binary = files.unpack(result.glb)
    extension = tree["meshes"][0]["primitives"][0]["extensions"][NAMES["draco"]]
    view = tree["bufferViews"][extension["bufferView"]]
    mesh = DracoPy.decode(bytes(binary[view["byteOffset"] :][: view["byteLength"]]))
    parts = {part["unique_id"]: part["data"] for part in mesh.attributes}
    return {name: parts[number] for name, number in extension["attributes"].items()}


@pytest.mark.parametrize("compress", NAMES)
def test_compressed_output_is_smaller_declared_and_valid(compress, tmp_path):
    plain, packed = refine(sample()), refine(sample(), compress)
    assert len(packed.glb) < len(plain.glb)
    tree, _ = files.unpack(packed.glb)
    assert tree["extensionsUsed"] == tree["extensionsRequired"] == [NAMES[compress]]
    assert any(what.startswith(SAYS[compress]) for what in whats(packed))
    (tmp_path / "a.glb").write_bytes(packed.glb)
    assert validator.errors([tmp_path / "a.glb"]) == [[]]


@pytest.mark.parametrize("compress", ["none", *NAMES])
def test_the_report_counts_the_vertices_of_the_file(compress):
    # Draco joins what is alike: both sides of a hard edge inside a plane.
    square = {
        "POSITION": np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]),
        "NORMAL": np.array([[0.0, 0, 1]] * 3 + [[0.01, 0, 1]] * 3),
        "indices": np.arange(6).reshape(-1, 3),
    }
    packed = refine(files.glb([square], [octahedron(), box()]), compress)
    tree, _ = files.unpack(packed.glb)
    primitives = [each for mesh in tree["meshes"] for each in mesh["primitives"]]
    accessors = [tree["accessors"][each["attributes"]["POSITION"]] for each in primitives]
    assert packed.report["totals"]["vertices"] == sum(each["count"] for each in accessors)


@pytest.mark.parametrize("compress", NAMES)
def test_refining_compressed_output_is_refining_plain_output(compress):
    plain, packed = (refine(refine(sample(), kind).glb, levels=1) for kind in ("none", compress))
    assert "extensionsUsed" not in files.unpack(packed.glb)[0]
    for mesh, primitive in [(0, 0), (0, 1), (1, 0)]:
        wanted, unpacked = (triangles(r.glb, mesh, primitive) for r in (plain, packed))
        assert wanted.keys() == unpacked.keys()
        points = [np.sort(x["POSITION"].reshape(-1, 3), axis=0) for x in (unpacked, wanted)]
        np.testing.assert_allclose(*points, atol=1e-6 if compress == "meshopt" else 2 * STEP)
        for name in {"_ID", "COLOR_0"} & wanted.keys():
            assert unpacked[name].dtype == wanted[name].dtype


@pytest.mark.parametrize("compress", NAMES)
def test_a_strip_is_written_as_the_triangles_that_it_is(compress):
    strip = octahedron(indices=np.array([[0], [2], [4], [1], [3]]), mode=5)
    result = refine(files.glb([strip]), compress, levels=1).glb
    assert files.unpack(result)[0]["meshes"][0]["primitives"][0].get("mode", 4) == 4


# Draco's grid


def ball(size, origin=0.0):
    """An octahedron with the normals of the sphere around it."""
    points = octahedron()["POSITION"]
    return octahedron(POSITION=origin + size * points, NORMAL=points)


SIZES = [(box(), 0.0)]
SIZES += [(ball(size), 0.0) for size in np.geomspace(2e-5, 1.0, 30)]
SIZES += [(ball(size, at), at) for at in (5.4321, 987.6) for size in np.geomspace(0.01, 1.0, 10)]


@pytest.mark.parametrize(("shape", "origin"), SIZES, ids=range(len(SIZES)))
def test_draco_rounds_no_more_than_it_says(shape, origin):
    """It hands on its grid as text of six decimals: beside a part of millimetres in metres that is
    coarse."""
    data = files.glb([shape])
    plain, stored = files.primitive_of(refine(data).glb)[1], decoded(refine(data, "draco"))
    distance = np.abs(stored["POSITION"][:, None] - plain["POSITION"]).max(axis=2)
    nearest = distance.argmin(axis=1)
    extent = np.ptp(plain["POSITION"], axis=0).max()
    limit = 0.51 * (extent + 4e-6) * STEP + np.spacing(np.float32(origin))
    assert distance.min(axis=1).max() <= limit
    np.testing.assert_allclose(np.linalg.norm(stored["NORMAL"], axis=1), 1, atol=2.0**-NORMAL_BITS)
    if "TANGENT" not in shape:
        # Hard edges have several in one place.
        wanted = plain["NORMAL"][nearest]
        np.testing.assert_allclose(stored["NORMAL"], wanted, atol=4 * 2.0**-NORMAL_BITS)


def test_what_draco_cannot_hold_stays_uncompressed_and_is_named():
    """Meshes too small for its grid, and morph targets."""
    data = files.glb([ball(1e-8)])
    packed, plain = refine(data, "draco"), refine(data)
    assert whats(packed) == [UNHELD]
    for ours, wanted in zip(*map(files.primitive_of, (packed.glb, plain.glb)), strict=True):
        np.testing.assert_equal(ours, wanted)
    moved = octahedron(targets=[{"POSITION": np.ones((6, 3))}])
    result = refine(files.glb([moved]), "draco")
    after, _ = files.unpack(result.glb)
    assert "extensions" not in after["meshes"][0]["primitives"][0]
    assert "extensionsUsed" not in after
    told = {"pointer": "/meshes/0/primitives/0", "code": "not-draco", "what": UNHELD, "count": 1}
    assert told in result.report["changes"]


def test_a_vertex_of_too_many_faces_stays_uncompressed_under_draco(monkeypatch):
    """Of 40,000 faces around one edge Draco took seconds; it grows with their square."""
    monkeypatch.setattr(DracoPy, "encode", lambda *_, **__: pytest.fail("it is left to Draco"))
    count = 40_000
    points = np.random.default_rng(0).normal(size=(count + 2, 3))
    faces = np.stack([np.zeros(count), np.ones(count), np.arange(2, count + 2)], axis=1).astype(int)
    fan = files.glb([{"POSITION": points, "indices": faces}])
    # New normals would part the fan.
    assert whats(refine(fan, "draco", levels=1, normals="keep")) == [UNHELD]


def test_seams_between_primitives_do_not_open_on_dracos_grid():
    # A sheet cut in two: the halves have different extents, and one grid.
    x, y = np.meshgrid(np.linspace(0, 1, 9) ** 2, np.linspace(0, 0.7, 5), indexing="ij")
    points = np.stack([x.reshape(-1), y.reshape(-1), np.sin(3 * x.reshape(-1))], axis=1)
    corner = (np.arange(8)[:, None] * 5 + np.arange(4)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, 5, 1]), np.add(corner, [1, 5, 6])])
    left = (faces < 20).any(axis=1)
    data = files.glb([{"POSITION": points, "indices": faces[side]} for side in (left, ~left)])
    again, whole = (
        refine(refine(data, kind).glb, levels=1).report["levels"][0]["edges"]
        for kind in ("draco", "none")
    )
    assert again == whole
    assert whole["irregular"] == 0
