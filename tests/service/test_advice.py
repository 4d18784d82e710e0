"""advice: where the result is in doubt or little changed, and the option that helps."""

import re

import numpy as np
import pytest

from pns_common import Creases, Mesh, load_model
from service.advice import Bends, advice_on, count_bends
from service.changes import with_flags
from service.gltf.subdivide import subdivide_gltf
from service.meshfiles.convert import converted
from service.options import Limits, Options
from tests.service.gltf.test_options import cylinder
from tests.support.gltf.files import glb
from tests.support.gltf.shapes import box, octahedron

AUTO = Options()


def report_of(*meshes, **options):
    chosen = Options(**{"scheme": "loop"} | options)
    model = load_model() if chosen.scheme == "auto" else None
    data = glb(*([mesh] for mesh in meshes))
    return subdivide_gltf(data, "glb", chosen, model, Limits()).report


def advice(*meshes, **options):
    return [each["text"] for each in report_of(*meshes, **options)["advice"]]


def mesh_of(shape):
    return Mesh(shape["POSITION"].astype(np.float64), np.reshape(shape["indices"], (-1, 3)))


def prism(sides):
    """A drum of two rings, whose rims bend by 90 degrees."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    low, high = (np.column_stack([ring, np.full(sides, z)]) for z in (-1.0, 1.0))
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    walls = [[here, there, sides + there], [here, sides + there, sides + here]]
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [*walls, [there, here, bottom], [sides + here, sides + there, top]]
    points = np.vstack([low, high, [[0, 0, -1], [0, 0, 1]]])
    return Mesh(points, np.concatenate([np.column_stack(each) for each in faces]))


def as_gltf(mesh):
    return {"POSITION": mesh.vertices.astype(np.float32), "indices": mesh.faces.reshape(-1)}


def weighted(mesh, weight):
    """Creases as the network gives them: one weight at every edge."""
    edges = mesh.topology().edges.astype(np.int64)
    return Creases(edges, np.full(len(edges), weight))


@pytest.mark.parametrize("shape", [box(), cylinder(), as_gltf(prism(12)), as_gltf(prism(32))])
def test_sharp_parts_are_never_offered_a_rounder_shape(shape):
    assert advice(shape, scheme="auto") == []


@pytest.mark.parametrize("crease", ["off", "angle:60", "angle:100", "normals"])
def test_who_says_which_edges_are_sharp_is_not_asked_again(crease):
    assert advice(box(), octahedron(), scheme="auto", crease=crease) == []


@pytest.mark.parametrize(
    ("weight", "expected"),
    [(0.0, Bends(12, 0, 12)), (0.5, Bends(12, 12, 12)), (0.51, Bends(12, 12)), (1.0, Bends(12))],
)
def test_an_edge_is_undecided_between_a_fifth_and_four_fifths(weight, expected):
    # An octahedron's 12 edges bend by 70.5 degrees.
    mesh = mesh_of(octahedron())
    assert count_bends(mesh, weighted(mesh, weight), AUTO) == [expected]


LEVEL = report_of(octahedron())["levels"]


def test_a_doubt_names_the_two_pictures_that_it_may_lead_to():
    (doubt,) = advice_on(LEVEL, Bends(40, 22))
    assert doubt.text == (
        "22 of 40 steep edges are neither clearly sharp nor clearly round: use crease=off for a "
        "body that is round throughout, or crease=angle:40 for flat sides with crisp edges"
    )
    assert doubt.options == ("crease=off", "crease=angle:40")
    assert re.findall(r"--crease \S+", with_flags(doubt)) == ["--crease off", "--crease angle:40"]


def test_a_part_that_keeps_no_edge_is_spoken_of_first():
    (doubt,) = advice_on(LEVEL, Bends(40, 40, 14))
    assert doubt.text.startswith("no edge is kept sharp where 14 bend by more than 60 degrees: use")
    assert doubt.options == ("crease=angle:40",)


def test_triangles_that_share_no_vertex_say_how_to_join_them():
    shape = octahedron()
    corners = shape["POSITION"][np.reshape(shape["indices"], -1)].astype(np.float64)
    apart = corners + 1e-5 * np.arange(len(corners))[:, None]
    (line,) = advice({"POSITION": apart.astype(np.float32), "indices": np.arange(24)})
    assert line.startswith("24 of 24 edges are open borders")
    assert "weld_tolerance=" in line


def test_a_flat_sheet_says_that_it_is_flat():
    sheet = {
        "POSITION": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32),
        "indices": np.array([0, 1, 2, 2, 1, 3]),
    }
    (line,) = advice(sheet)
    assert line.startswith("the shape is flat")


@pytest.mark.parametrize("faces", ["f 1 2 3", "f 1 2 3 4", "f 1 2 3 4 5"])
@pytest.mark.parametrize("count", [1, 2])
def test_only_faces_that_have_others_are_to_be_joined(faces, count):
    corners = [(0, 0), (2, 0), (2, 2), (1, 3), (0, 2)]
    lines = [f"v {x + 9 * k} {y} 0" for k in range(count) for x, y in corners]
    lines += [faces, faces.translate(str.maketrans("12345", "6789X")).replace("X", "10")][:count]
    options = Options(scheme="loop" if faces == "f 1 2 3" else "catmull-clark")
    made = converted("\n".join(lines).encode(), "obj", "obj", options, None, Limits())
    (told,) = made.report["advice"]
    assert bool(told["options"]) == (count == 2)
