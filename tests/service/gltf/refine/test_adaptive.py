"""Faces of several levels in files: no gaps, and all that is carried where whole levels put it."""

import numpy as np
import pytest

from pns_common import Mesh, load_model, loop, refine, subdivide
from service.errors import InvalidParameter, LimitError
from service.gltf.subdivide import subdivide_gltf
from service.meshfiles.convert import converted
from service.options import Limits, Options
from service.stages import Stages
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron
from tests.support.meshes import bumpy_sphere
from tests.support.networks import random_model

GOAL = {"tolerance": "2%"}


def refined(*meshes, limits=None, **options):
    options = Options(**{"scheme": "loop", "normals": "keep", "crease": "off", **options})
    return subdivide_gltf(files.glb(*meshes), "glb", options, random_model(0), limits or Limits())


def shaped(**others):
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    return {"POSITION": points.astype(np.float32), "indices": faces, **others}


def library(**goal):
    shape = shaped()
    return refine(Mesh(shape["POSITION"].astype(float), shape["indices"]), loop(), **goal)


@pytest.mark.parametrize(
    "goal", [GOAL, {"angle": 20.0}, {"max_faces": 200}, {"max_edge_length": "12%"}]
)
def test_faces_are_the_librarys(goal):
    faces, attributes = files.primitive_of(refined([shaped()], **goal).glb)
    made = library(**goal).mesh
    np.testing.assert_allclose(attributes["POSITION"][faces], made.vertices[made.faces], atol=1e-6)


def test_the_most_faces_are_those_of_the_file():
    coarse, fine = (bumpy_sphere(subdivisions=level, bump=0.3) for level in (0, 1))
    meshes = [[{"POSITION": p.astype(np.float32), "indices": f}] for p, f in (coarse, fine)]
    one, other = (len(faces) for _, faces in (coarse, fine))
    made = refined(*meshes, max_faces=3000)
    counts = [mesh["adaptive"]["faces"] for mesh in made.report["meshes"]]
    assert 0.9 * 3000 * one / (one + other) < counts[0] <= 3000 * one / (one + other)
    assert sum(counts) <= 3000
    with pytest.raises(InvalidParameter, match=f"at least {one + other}"):
        refined(*meshes, max_faces=one + other - 1)


def test_texture_coordinates_are_linear_on_both_sides_of_a_seam():
    shape = shaped()
    faces, made = shape["indices"], library(**GOAL)
    corners = np.random.default_rng(0).random((faces.size, 2)).astype(np.float32)
    apart = {
        "POSITION": shape["POSITION"][faces.reshape(-1)],
        "indices": np.arange(faces.size).reshape(-1, 3),
        "TEXCOORD_0": corners,
    }
    there, attributes = files.primitive_of(refined([apart], **GOAL).glb)
    np.testing.assert_allclose(
        attributes["POSITION"][there], made.mesh.vertices[made.mesh.faces], atol=1e-6
    )
    np.testing.assert_allclose(attributes["TEXCOORD_0"][there], made.at_corners(corners), atol=1e-6)


def test_skins_follow_the_masks():
    shape = shaped()
    weights = np.random.default_rng(1).dirichlet(np.ones(3), len(shape["POSITION"]))
    bound = shaped(
        JOINTS_0=np.tile(np.array([0, 1, 2, 0], dtype=np.uint8), (len(weights), 1)),
        WEIGHTS_0=np.column_stack([weights, np.zeros(len(weights))]).astype(np.float32),
    )
    faces, attributes = files.primitive_of(refined([bound], **GOAL).glb)
    made = library(**GOAL)
    total = np.zeros((len(attributes["POSITION"]), 3))
    rows = np.arange(len(total))[:, None]
    np.add.at(total, (rows, attributes["JOINTS_0"].astype(int)), attributes["WEIGHTS_0"])
    np.testing.assert_allclose(total[faces], made.carry(weights)[made.mesh.faces], atol=1e-6)


def test_normals_are_those_of_the_limit_surface():
    faces, attributes = files.primitive_of(refined([shaped()], normals="smooth", **GOAL).glb)
    made = library(**GOAL)
    np.testing.assert_allclose(
        attributes["NORMAL"][faces], made.normals[made.mesh.faces], atol=1e-5
    )


def test_normals_of_their_author_stay():
    up = np.tile([0.0, 0.0, 1.0], (len(shaped()["POSITION"]), 1)).astype(np.float32)
    _, attributes = files.primitive_of(refined([shaped(NORMAL=up)], **GOAL).glb)
    assert (attributes["NORMAL"] == [0, 0, 1]).all(axis=1).mean() > 1 / 2


@pytest.mark.parametrize("goal", [GOAL, {"max_faces": 150}])
def test_primitives_without_normals_beside_others_are_refined_alike(goal):
    one, shape = shaped(), shaped()
    shape["POSITION"] = shape["POSITION"] * [0.5, 1, 2] + [10, 0, 0]
    bare = [one, {**shape, "POSITION": shape["POSITION"].astype(np.float32)}]
    up = np.tile([0.0, 0.0, 1.0], (len(one["POSITION"]), 1)).astype(np.float32)
    made, plain = (
        refined([{**one, **normals}, bare[1]], **goal).glb for normals in ({"NORMAL": up}, {})
    )
    for number in (0, 1):
        mine, its = (files.primitive_of(glb, primitive=number) for glb in (made, plain))
        np.testing.assert_array_equal(mine[1]["POSITION"][mine[0]], its[1]["POSITION"][its[0]])


def test_mesh_files_are_refined_alike():
    shape, made = shaped(), library(**GOAL)
    rows = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in shape["POSITION"].astype(float).tolist())
    rows += "".join(f"f {a} {b} {c}\n" for a, b, c in (shape["indices"] + 1).tolist())
    options = Options(scheme="loop", normals="keep", crease="off", **GOAL)
    written = converted(rows.encode(), "obj", "obj", options, None, Limits())
    lines = [line.split() for line in written.content.decode().splitlines()]
    points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=float)
    faces = np.array(
        [[int(at.split("/")[0]) - 1 for at in line[1:]] for line in lines if line[:1] == ["f"]]
    )
    np.testing.assert_allclose(points[faces], made.mesh.vertices[made.mesh.faces], atol=1e-9)
    assert written.report["meshes"][0]["adaptive"]["faces"] == len(faces)


def test_data_of_other_libraries_follow():
    trimesh = pytest.importorskip("trimesh")
    points, faces = bumpy_sphere(subdivisions=0, bump=0.3)
    mesh = trimesh.Trimesh(points, faces, process=False)
    mesh.vertex_attributes["height"] = points[:, 2:]
    made = subdivide(mesh, scheme=loop(), tolerance="2%")
    assert made.is_watertight
    assert len(made.vertices) == len(made.vertex_attributes["height"])
    np.testing.assert_array_equal(made.vertex_attributes["height"][: len(points)], points[:, 2:])


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"tolerance": "0"}, "tolerance"),
        ({"tolerance": "-1"}, "tolerance"),
        ({"tolerance": "nan"}, "tolerance"),
        ({"angle": 0.0}, "angle"),
        ({"angle": 180.0}, "angle"),
        ({"angle": float("nan")}, "angle"),
        ({"max_edge_length": "1 mm"}, "max_edge_length"),
        ({"max_faces": 0}, "max_faces"),
        ({"tolerance": "1", "uv": "smooth"}, "uv"),
        ({"tolerance": "1", "limit": False}, "limit"),
        ({"angle": 9.0, "scheme": "catmull-clark"}, "scheme"),
        ({"max_faces": 100, "material": "a"}, "material"),
    ],
)
def test_what_cannot_be_is_said(options, name):
    with pytest.raises(InvalidParameter) as error:
        Options(**options)
    assert error.value.name == name


def test_fewer_faces_than_there_are_is_an_error_that_says_how_many_are_possible():
    with pytest.raises(InvalidParameter, match="at least 8") as error:
        refined([octahedron()], max_faces=3)
    assert error.value.name == "max_faces"


def test_triangles_of_a_gltf_do_not_become_polygons_of_several_levels():
    with pytest.raises(InvalidParameter, match="stay triangles: leave scheme out") as error:
        refined([octahedron()], scheme="catmull-clark", tolerance="1%")
    assert error.value.name == "scheme"


def test_what_whole_levels_would_make_is_no_reason_to_refuse():
    shape, most = shaped(), Limits(max_faces=60)
    rows = "".join(f"v {x} {y} {z}\n" for x, y, z in shape["POSITION"].tolist())
    rows += "".join(f"f {a} {b} {c}\n" for a, b, c in (shape["indices"] + 1).tolist())
    asked = Options(scheme="loop", max_faces=50), None
    for goal in ({"tolerance": "90%"}, {"max_faces": 50}):
        assert refined([shape], limits=most, **goal).report["totals"]["faces"] <= 50
    assert converted(rows.encode(), "obj", "obj", *asked, most).faces <= 50
    with pytest.raises(LimitError) as refusal:
        refined([shape], limits=most, max_faces=70)
    assert refusal.value.found == 70


@pytest.mark.parametrize("goal", [{"tolerance": "0.1%"}, {"angle": 10.0}, {"max_faces": 900}])
def test_progress_moves_through_the_work_and_its_stages(goal):
    told, begun = [], []
    stages = Stages(begins=begun.append, moves=told.append)
    data, options = files.glb([shaped()]), Options(**goal)
    subdivide_gltf(data, "glb", options, load_model(), Limits(), stages)
    assert told == sorted(told)
    assert told[-1] == 1
    assert np.diff(told).max() < 0.3
    assert begun.index("refine") < begun.index("attributes")
    assert stages.seconds["attributes"] > 0


def test_the_limit_of_faces_holds():
    with pytest.raises(LimitError):
        refined([shaped()], tolerance="0.01%", limits=Limits(max_faces=2000))
