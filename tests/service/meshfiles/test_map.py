"""A map makes the refined positions of those of the file, where the operator is linear."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, load_npz

from service.errors import InvalidParameter
from service.meshfiles import formats
from service.meshfiles.convert import Jobs, convert
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron
from tests.support.shared import shared_path


def mapped(source, target, **options):
    """Refine a file; return the result, and the file of the map."""
    output, parents = source.parent / f"out.{target}", source.parent / "map.npz"
    asked = Options(**({"scheme": "loop", "levels": 2} | options))
    model = "general" if asked.learns else None
    assert not [*convert(Jobs([source], output, map=parents), asked, model, Limits())]
    return output.read_bytes(), parents


@pytest.mark.parametrize("target", ["obj", "ply", "off", "stl", "3mf"])
@pytest.mark.parametrize("material", [None, "m1"])
@pytest.mark.parametrize("scheme", ["loop", "catmull-clark"])
def test_a_map_of_one_matrix_makes_the_positions(target, material, scheme, tmp_path):
    data = (shared_path("cases") / "obj_two_materials.obj").read_bytes()
    (tmp_path / "in.obj").write_bytes(data)
    made, parents = mapped(tmp_path / "in.obj", target, material=material, scheme=scheme)
    again = load_npz(parents) @ formats.read(data, "obj").vertices
    np.testing.assert_allclose(again, formats.read(made, target).vertices, atol=1e-6)


def assert_map_of_gltf(data, made, parents):
    """Check every primitive of the result by its matrix; return how many there are."""
    tree, binary = files.unpack(data)
    arrays, checked = np.load(parents), 0
    for mesh, entry in enumerate(tree["meshes"]):
        before = [
            files.values_of(tree, binary, primitive["attributes"]["POSITION"])
            for primitive in entry["primitives"]
        ]
        offsets = np.cumsum([0, *map(len, before)])
        np.testing.assert_array_equal(arrays[f"meshes/{mesh}/offsets"], offsets)
        for number in range(len(before)):
            own = f"meshes/{mesh}/primitives/{number}/"
            if f"{own}data" not in arrays:
                continue
            parts = (arrays[own + name] for name in ("data", "indices", "indptr"))
            matrix = csr_matrix(tuple(parts), arrays[f"{own}shape"])
            points = np.concatenate(before).astype(np.float64)
            _, after = files.primitive_of(made, mesh, number)
            size = np.abs(points).max()
            np.testing.assert_allclose(matrix @ points, after["POSITION"], atol=1e-6 * size)
            checked += 1
    return checked


def halves(**others):
    """An octahedron in two primitives with seams between them, lines among them."""
    whole = octahedron()
    points, faces = whole["POSITION"], whole["indices"]
    # Vertices that no face uses before and behind those that are.
    first = {"POSITION": np.vstack([points[:1] + 7, points]), "indices": faces[:4] + 1}
    lines = {"POSITION": points[:2], "mode": 1}
    return [first, lines, {"POSITION": points[faces[4:]].reshape(-1, 3), **others}]


@pytest.mark.parametrize(
    "options",
    [
        *({}, {"normals": "keep", "levels": 1}, {"weld": "off"}, {"compress": "meshopt"}),
        {"scheme": "pns", "budget": 0.0},
        {"scheme": "catmull-clark", "polygons": "auto"},
    ],
)
def test_each_primitive_of_a_gltf_has_a_matrix_over_its_mesh(options, tmp_path):
    flat = {"POSITION": np.zeros((3, 3)), "indices": np.array([[0, 0, 1]])}
    tree, binary = files.document(halves(), [box()], [flat], [octahedron()])
    # The geometry of another mesh, which is refined once.
    tree["meshes"].append(tree["meshes"][0])
    data = files.pack(tree, bytes(binary))
    (tmp_path / "in.glb").write_bytes(data)
    made, parents = mapped(tmp_path / "in.glb", "glb", **options)
    if "compress" in options:
        made, _ = mapped(tmp_path / "in.glb", "glb")
    assert assert_map_of_gltf(data, made, parents) == 6


@pytest.mark.parametrize("name", ["Fox", "MorphStressTest", "barrel_large_decorated", "cow"])
def test_maps_of_assets_make_their_positions(name, tmp_path):
    data = (shared_path("assets") / f"{name}.glb").read_bytes()
    (tmp_path / "in.glb").write_bytes(data)
    made, parents = mapped(tmp_path / "in.glb", "glb", levels=1)
    assert assert_map_of_gltf(data, made, parents)


@pytest.mark.parametrize(
    ("output", "options"), [("out.obj", {}), ("out.glb", {"compress": "draco"})]
)
def test_what_numbers_vertices_anew_has_no_map(output, options, tmp_path):
    (tmp_path / "in.glb").write_bytes(files.glb([box()]))
    jobs = Jobs([tmp_path / "in.glb"], tmp_path / output, map=tmp_path / "map.npz")
    with pytest.raises(InvalidParameter, match="map"):
        list(convert(jobs, Options(scheme="loop", **options), None, Limits()))
