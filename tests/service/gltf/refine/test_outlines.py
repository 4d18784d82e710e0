"""CESIUM_primitive_outline: lines lie along the same edges when a primitive is refined."""

import numpy as np
import pytest

from service.errors import GltfError
from service.gltf.subdivide import subdivide_gltf
from service.meshfiles.convert import converted
from service.options import Limits, Options
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron

NAME = "CESIUM_primitive_outline"
# The sides of a cube's faces, and the diagonal of one, which polygons have inside.
SIDES = [[4 * face + k, 4 * face + (k + 1) % 4] for face in range(6) for k in range(4)]


def outlined(pairs=SIDES, meshes=1, shape=box):
    """A GLB of meshes with lines between pairs of vertices of each."""
    tree, binary = files.document(*[[shape()] for _ in range(meshes)])
    index = files.add_accessor(tree, binary, np.array(pairs, np.uint16).reshape(-1, 1))
    for mesh in tree["meshes"]:
        mesh["primitives"][0]["extensions"] = {NAME: {"indices": index}}
    tree["extensionsUsed"] = [NAME]
    tree["buffers"][0]["byteLength"] = len(binary)
    return tree, binary


def refined(tree, binary, **options):
    chosen = Options(**{"scheme": "loop", "crease": "angle:60", **options})
    made = subdivide_gltf(files.pack(tree, binary), "glb", chosen, None, Limits())
    return made, *files.unpack(made.glb)


def lines_of(tree, binary, mesh=0):
    """The ends (N, 2, 3) of a mesh's lines, and whether each is a side of a triangle."""
    (primitive,) = tree["meshes"][mesh]["primitives"]
    points, faces, lines = (
        files.values_of(tree, binary, index)
        for index in (
            primitive["attributes"]["POSITION"],
            primitive["indices"],
            primitive["extensions"][NAME]["indices"],
        )
    )
    faces, lines = faces.reshape(-1, 3).astype(int), lines.reshape(-1, 2).astype(int)
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    known = {tuple(side) for side in sides.tolist()}
    assert all(tuple(sorted(line)) in known for line in lines.tolist())
    return points[lines]


@pytest.mark.parametrize("compress", ["none", "meshopt"])
@pytest.mark.parametrize(
    "options", [{}, {"scheme": "catmull-clark", "polygons": "auto"}, {"normals": "smooth"}]
)
def test_lines_follow_the_edges_of_a_cube(options, compress, tmp_path):
    made, tree, binary = refined(*outlined(), compress=compress, **options)
    if compress == "none":
        ends = lines_of(tree, binary)
        # Along an edge of the cube two coordinates stay, at 1 or -1.
        assert ((np.abs(ends) == 1) & (ends[:, :1] == ends[:, 1:])).all(axis=1).sum(
            axis=1
        ).min() == 2
        lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        # Twelve edges of length 2, seen from both of their faces, in four parts each.
        assert len(lengths) == 24 * 4
        assert lengths.sum() == pytest.approx(48)
    assert NAME in tree["extensionsUsed"]
    (tmp_path / "a.glb").write_bytes(made.glb)
    assert validator.errors([tmp_path / "a.glb"]) == [[]]
    assert not any(NAME in change["what"] for change in made.report["changes"])


def test_a_line_inside_of_a_smooth_surface_is_the_refined_edge():
    """Of an octahedron its equator, of which each vertex stays in its plane."""
    tree, binary = outlined([[0, 2], [2, 1], [1, 3], [3, 0]], shape=octahedron)
    _, tree, binary = refined(tree, binary, crease="off", levels=3)
    ends = lines_of(tree, binary)
    assert len(ends) == 4 * 8
    assert (ends[..., 2] == 0).all()
    assert len(np.unique(ends.reshape(-1, 3), axis=0)) == 4 * 8


def test_meshes_of_one_geometry_and_meshes_refined_together_have_their_own():
    shared, binary = outlined(meshes=2)
    _, tree, written = refined(shared, binary)
    np.testing.assert_array_equal(lines_of(tree, written, 0), lines_of(tree, written, 1))
    # The same accessors, and another outline.
    fewer = files.add_accessor(shared, binary, np.array(SIDES[:4], np.uint16).reshape(-1, 1))
    first = shared["meshes"][0]["primitives"][0]
    shared["meshes"][1]["primitives"][0] |= {
        "attributes": first["attributes"],
        "indices": first["indices"],
        "extensions": {NAME: {"indices": fewer}},
    }
    shared["buffers"][0]["byteLength"] = len(binary)
    _, tree, written = refined(shared, binary)
    # A line is drawn from both of its faces.
    assert [len(lines_of(tree, written, mesh)) for mesh in (0, 1)] == [96, 32]


def test_beside_a_chosen_part_lines_stay_whole_where_faces_do():
    tree, binary = outlined()
    tree["materials"] = [{"name": "a"}, {"name": "b"}]
    more = files.add_accessor(tree, binary, np.array(box()["indices"][:2]).reshape(-1, 1))
    rest = files.add_accessor(tree, binary, np.array(box()["indices"][2:]).reshape(-1, 1))
    first = tree["meshes"][0]["primitives"][0]
    tree["meshes"][0]["primitives"] = [
        first | {"indices": more, "material": 0},
        first | {"indices": rest, "material": 1},
    ]
    tree["buffers"][0]["byteLength"] = len(binary)
    _, tree, written = refined(tree, binary, material="a", levels=1, weld="position")
    counts = []
    for primitive in tree["meshes"][0]["primitives"]:
        alone = {**tree, "meshes": [{"primitives": [primitive]}]}
        lengths = np.linalg.norm(np.diff(lines_of(alone, written), axis=1), axis=2)
        counts.append((len(lengths), round(float(lengths.sum()), 5)))
    # The chosen side: four edges in two. Of the others four edges are cut, and sixteen are whole.
    assert counts == [(8, 8.0), (24, 40.0)]


def test_draco_leaves_lines_out_and_says_so():
    made, tree, _ = refined(*outlined(), compress="draco")
    assert "extensionsUsed" not in tree or NAME not in tree["extensionsUsed"]
    assert NAME not in tree["meshes"][0]["primitives"][0]["extensions"]
    told = {change["what"] for change in made.report["changes"]}
    assert f"{NAME} left out: Draco orders vertices anew" in told


def test_lines_that_are_no_edges_go():
    points = box()["POSITION"]
    (across,) = np.flatnonzero((points == -points[0]).all(axis=1))[:1]
    _, tree, _ = refined(*outlined([[0, across]]))
    assert "extensions" not in tree["meshes"][0]["primitives"][0]
    assert NAME not in tree.get("extensionsUsed", [])


def test_other_formats_say_that_lines_are_lost():
    data = files.pack(*outlined())
    made = converted(data, "glb", "obj", Options(scheme="loop"), None, Limits())
    told = {change["what"]: change["count"] for change in made.report["changes"]}
    assert told["outlines dropped: not written to OBJ files"] == 1


@pytest.mark.parametrize(
    ("entry", "pairs", "says"),
    [
        ({}, SIDES, "names an accessor"),
        ({"indices": 99}, SIDES, "99"),
        ({"indices": 0}, SIDES, "pairs of unsigned scalars"),
        (None, [0, 1, 2], "pairs of unsigned scalars"),
        (None, [[0, 24]], "index 24, but there are 24 vertices"),
    ],
)
def test_an_outline_that_is_none_is_refused(entry, pairs, says):
    tree, binary = outlined(pairs)
    if entry is not None:
        tree["meshes"][0]["primitives"][0]["extensions"][NAME] = entry
    with pytest.raises(GltfError, match=says):
        refined(tree, binary)
