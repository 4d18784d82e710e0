"""Triangles of a glTF that come from polygons: found, refined by Catmull–Clark, written back."""

import numpy as np
import pytest

from pns_common import Mesh, catmull_clark, load_model, refine
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron

CUBE = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
)
POINTS = np.array(
    [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]],
    dtype=float,
)


def halves(quads, flip=False):
    """Both triangles of each quad, one after the other."""
    order = [[1, 2, 3], [1, 3, 0]] if flip else [[0, 1, 2], [0, 2, 3]]
    return quads[:, order].reshape(-1, 3)


def cube(flip=False, **attributes):
    return {"POSITION": POINTS, "indices": halves(CUBE, flip), **attributes}


def subdivide(*primitives, edit=None, model=None, **options):
    data = files.glb(list(primitives))
    if edit is not None:
        tree, binary = files.unpack(data)
        edit(tree)
        data = files.pack(tree, binary)
    options = Options(**{"scheme": "catmull-clark", "levels": 2, "polygons": "auto", **options})
    return subdivide_gltf(data, "glb", options, model, Limits())


def sorted_rows(points):
    return points[np.lexsort(np.round(points, 5).T)]


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_triangulated_cube_has_the_vertices_of_its_quads(levels, flip):
    made = subdivide(cube(flip), levels=levels)
    faces, attributes = files.primitive_of(made.glb)
    expected = refine(Mesh(POINTS, CUBE), catmull_clark(), levels).mesh
    assert len(faces) == 2 * len(expected.faces) == 12 * 4**levels
    np.testing.assert_allclose(
        sorted_rows(attributes["POSITION"]), sorted_rows(expected.vertices), atol=1e-6
    )
    corners = attributes["POSITION"][faces]
    volume = np.linalg.det(corners.astype(float)).sum() / 6
    triangles = expected.triangulated()
    own = np.linalg.det(triangles.vertices[triangles.faces]).sum() / 6
    assert volume == pytest.approx(own, rel=0.02)


def test_off_refines_triangles_as_they_are():
    made = subdivide(cube(), polygons="off")
    expected = refine(Mesh(POINTS, halves(CUBE)), catmull_clark(), 2).mesh
    _, attributes = files.primitive_of(made.glb)
    np.testing.assert_allclose(
        sorted_rows(attributes["POSITION"]), sorted_rows(expected.vertices), atol=1e-6
    )


def test_auto_joins_a_file_of_quads_and_leaves_one_of_triangles():
    model = load_model()
    for shape, name in ((cube(), "general-quad"), (octahedron(), "general")):
        made = subdivide(shape, scheme="auto", model=model)
        assert made.report["model"] == name
    assert subdivide(cube(), scheme="auto", model=model, polygons="off").report["model"] == (
        "general"
    )
    assert subdivide(cube(), scheme="loop").report["scheme"] == "loop"


def test_a_fan_that_the_file_calls_a_polygon_is_one():
    angle = 2 * np.pi * np.arange(6) / 6
    points = np.stack([np.cos(angle), np.sin(angle), np.cos(3 * angle) / 2], axis=1)
    fan = np.array([[0, k, k + 1] for k in range(1, 5)])

    def name(tree):
        tree["extensionsUsed"] = ["FB_ngon_encoding"]
        tree["meshes"][0]["primitives"][0]["extensions"] = {"FB_ngon_encoding": {}}

    made = subdivide({"POSITION": points, "indices": fan}, edit=name, levels=1)
    expected = refine(Mesh(points, np.arange(6)[None]), catmull_clark(), 1).mesh
    faces, attributes = files.primitive_of(made.glb)
    assert len(faces) == 12
    np.testing.assert_allclose(
        sorted_rows(attributes["POSITION"]), sorted_rows(expected.vertices), atol=1e-6
    )
    tree, _ = files.unpack(made.glb)
    assert "extensionsUsed" not in tree
    assert "extensions" not in tree["meshes"][0]["primitives"][0]
    assert any("FB_ngon_encoding" in change["what"] for change in made.report["changes"])


def test_attributes_are_those_of_the_polygons_corners():
    colours = files.Normalized(np.arange(32, dtype=np.uint8).reshape(8, 4))
    shape = cube(TEXCOORD_0=POINTS[:, :2], COLOR_0=colours, _FEATURE_ID_0=np.arange(8.0)[:, None])
    made = subdivide(shape, levels=2, normals="smooth")
    _, attributes = files.primitive_of(made.glb)
    # Linear inside of each quad: the lattice of its corners.
    steps = np.linspace(0, 1, 5)
    assert set(attributes["TEXCOORD_0"][:, 1].round(6)) == set(steps)
    assert set(attributes["TEXCOORD_0"][:, 0].round(6)) == set(2 * steps)
    assert set(attributes["_FEATURE_ID_0"].reshape(-1)) <= set(range(8))
    assert attributes["COLOR_0"].dtype == np.uint8
    np.testing.assert_allclose(np.linalg.norm(attributes["NORMAL"], axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("levels", [1, 2])
def test_smooth_texture_coordinates_follow_the_surface_inside_their_chart(levels):
    """A flat grid whose coordinates are its positions: both stay equal but on the rim."""
    side = np.arange(5.0)
    points = np.array([[x, y, 0] for y in side for x in side])
    first = np.array([5 * y + x for y in range(4) for x in range(4)])[:, None]
    shape = {"POSITION": points, "indices": halves(first + np.array([0, 1, 6, 5]))}
    rng = np.random.default_rng(0)
    shape["POSITION"][:, :2] += rng.uniform(-0.2, 0.2, (25, 2))
    shape["TEXCOORD_0"] = shape["POSITION"][:, :2]
    made = subdivide(shape, uv="smooth", levels=levels, border="fixed")
    _, attributes = files.primitive_of(made.glb)
    np.testing.assert_allclose(attributes["TEXCOORD_0"], attributes["POSITION"][:, :2], atol=1e-6)


def test_skins_and_morphs_follow_the_masks_of_the_positions():
    rng = np.random.default_rng(1)
    weights = np.zeros((8, 4))
    weights[:, :3] = rng.dirichlet(np.ones(3), 8)
    joints = np.tile(np.array([0, 1, 2, 0], dtype=np.uint8), (8, 1))
    delta = rng.normal(size=(8, 3))
    shape = cube(JOINTS_0=joints, WEIGHTS_0=weights, targets=[{"POSITION": delta}])
    made = subdivide(shape, levels=2)
    tree, binary = files.unpack(made.glb)
    primitive = tree["meshes"][0]["primitives"][0]
    _, attributes = files.primitive_of(made.glb)
    moved = files.values_of(tree, binary, primitive["targets"][0]["POSITION"])
    expected = refine(Mesh(POINTS + delta, CUBE), catmull_clark(), 2).mesh
    np.testing.assert_allclose(
        sorted_rows(attributes["POSITION"] + moved), sorted_rows(expected.vertices), atol=1e-5
    )
    np.testing.assert_allclose(attributes["WEIGHTS_0"].sum(axis=1), 1, atol=1e-6)
    columns = refine(Mesh(weights[:, :3], CUBE), catmull_clark(), 2).mesh.vertices
    dense = np.zeros((len(moved), 3))
    rows = np.arange(len(moved))[:, None]
    np.add.at(dense, (rows, attributes["JOINTS_0"].astype(int)), attributes["WEIGHTS_0"])
    np.testing.assert_allclose(sorted_rows(dense), sorted_rows(columns), atol=1e-5)


def test_copies_of_faces_follow_the_faces_that_they_copy():
    """Double-sided modelling: each quad a second time, the other way round."""
    front = halves(CUBE)
    indices = np.concatenate([front, 8 + front[:, ::-1]])
    away = POINTS - POINTS.mean(axis=0)
    away /= np.linalg.norm(away, axis=1)[:, None]
    shape = {"POSITION": np.tile(POINTS, (2, 1)), "NORMAL": np.concatenate([away, -away])}
    made = subdivide(shape | {"indices": indices}, levels=2)
    assert made.report["totals"]["copied_faces"] == 12
    faces, attributes = files.primitive_of(made.glb)
    points = attributes["POSITION"]
    front, back = np.split(points[faces], 2)
    sides = [{tuple(face.mean(axis=0).round(4)) for face in side} for side in (front, back)]
    assert sides[0] == sides[1]
    assert len(sides[0]) == len(faces) // 2
    a, b, c = np.moveaxis(points[faces], 1, 0)
    own = np.cross(b - a, c - a)
    assert ((own * attributes["NORMAL"][faces[:, 0]]).sum(axis=1) > 0).all()
    expected = refine(Mesh(POINTS, CUBE), catmull_clark(), 2).mesh.vertices
    assert {tuple(p) for p in (points + 0.0).round(4).tolist()} == {
        tuple(p) for p in (expected.astype(np.float32) + 0.0).round(4).tolist()
    }


def test_hard_edges_keep_a_normal_for_each_side():
    made = subdivide(box(), scheme="catmull-clark", crease="normals", levels=2)
    faces, attributes = files.primitive_of(made.glb)
    a, b, c = np.moveaxis(attributes["POSITION"][faces], 1, 0)
    own = np.cross(b - a, c - a)
    own /= np.linalg.norm(own, axis=1)[:, None]
    np.testing.assert_allclose(
        attributes["NORMAL"][faces], np.repeat(own[:, None], 3, axis=1), atol=1e-5
    )


def test_bent_and_reflex_pairs_are_no_quads():
    bent = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0]], dtype=float)
    dart = np.array([[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]], dtype=float)
    quad = np.arange(4)[None]
    for points in (bent, dart):
        made = subdivide({"POSITION": points, "indices": halves(quad)}, levels=1)
        assert made.report["totals"]["faces"] == 2 * 6


def test_a_mesh_of_quads_is_found_whatever_the_order_of_its_triangles():
    """Squares win over rhombi of halves of two; the order decides between equals alone."""
    side = np.arange(6.0)
    points = np.array([[x, y, 0.02 * x * y] for y in side for x in side])
    first = np.array([6 * y + x for y in range(5) for x in range(5)])[:, None]
    faces = halves(first + np.array([0, 1, 7, 6]))
    shuffled = np.random.default_rng(0).permutation(faces)
    for own in (faces, shuffled):
        made = subdivide({"POSITION": points, "indices": own}, levels=1)
        assert made.report["totals"]["faces"] == 25 * 8


def test_repeated_and_degenerate_triangles_do_no_harm():
    faces = np.concatenate([halves(CUBE), [[0, 0, 1], [0, 3, 2], [2, 3, 0]]])
    made = subdivide({"POSITION": POINTS, "indices": faces}, levels=2)
    assert made.report["dropped"]["degenerate_faces"] == 1
    _, attributes = files.primitive_of(made.glb)
    assert np.isfinite(attributes["POSITION"]).all()
