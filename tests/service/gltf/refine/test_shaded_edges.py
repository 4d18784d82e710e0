"""Hard edges of what is shaded smooth are kept, and lines however they are shaded."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import load_model
from pns_common.connectivity.topology import build_topology
from pns_common.crease_lines import LINES, named_on
from pns_common.geometry.crease_lines.turns import IN_ONE_PLANE, cosine_of, edges_beyond
from pns_common.geometry.frames import face_normals
from service.gltf.read.primitives import read_primitive
from service.gltf.read.upload import read_upload
from service.gltf.refine.control_mesh import control_mesh
from service.gltf.refine.hard_edges import hard_edges
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box
from tests.support.shared import shared_path

MODEL = load_model()
SIDES = 12


def spindle(shading, sides=SIDES):
    """Two steep cones, base to base, whose rim turns by 37 degrees: no line by its shape."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    step, after = np.arange(sides), (np.arange(sides) + 1) % sides
    points, normals, faces = [], [], []
    for side in (1.0, -1.0):
        slope = np.column_stack([3 * rim[:, :2], np.full(sides, side)])
        at_rim = rim if shading == "smooth" else slope
        start = len(points) * (sides + 1)
        points.append(np.vstack([rim, [[0, 0, 3 * side]]]))
        normals.append(np.vstack([at_rim, [[0, 0, side]]]))
        fan = np.column_stack([step, after, np.full(sides, sides)]) + start
        faces.append(fan if side > 0 else fan[:, ::-1])
    points, normals, faces = (np.concatenate(rows) for rows in (points, normals, faces))
    if shading == "flat":
        a, b, c = points[faces].transpose(1, 0, 2)
        points = points[faces].reshape(-1, 3)
        normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)
        faces = np.arange(len(points)).reshape(-1, 3)
    shape = {"POSITION": points, "NORMAL": normals / np.linalg.norm(normals, axis=1)[:, None]}
    return {name: np.float32(rows) for name, rows in shape.items()} | {"indices": faces}


def smooth_box():
    """A box of eight vertices, each with one normal: what tools write that ask nobody."""
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array(quads)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    rows = {"POSITION": corners, "NORMAL": corners / np.sqrt(3)}
    return {name: np.float32(values) for name, values in rows.items()} | {"indices": faces}


def refined(*meshes, model=MODEL, **options):
    given = Options(**{"levels": 3, "diagnostics": "none", **options})
    return subdivide_gltf(files.glb(*meshes), "glb", given, model, Limits())


def creases(result, mesh=0):
    levels = result.report["meshes"][mesh]["levels"]
    return [level["edges"].get("crease", 0) for level in levels]


def control_meshes(folder):
    """The meshes of a folder's files that have normals."""
    for path in sorted(folder.glob("*.glb")):
        upload = read_upload(path.read_bytes(), "glb", 1, Limits())
        for plan in upload.plans:
            primitives = [
                read_primitive(upload.document, upload.buffers, plan.mesh, number)
                for number in plan.primitives
            ]
            if any("NORMAL" in primitive.attributes for primitive in primitives):
                yield control_mesh(primitives, 0.0, None)


@pytest.mark.parametrize(
    ("shading", "kept"), [("hard rim", [12, 24, 0]), ("smooth", [0, 0, 0]), ("flat", [0, 0, 0])]
)
def test_a_hard_rim_is_kept_for_two_levels_where_the_rest_is_smooth(shading, kept):
    assert creases(refined([spindle(shading)])) == kept


@pytest.mark.parametrize("crease", ["lines", "off"])
def test_who_asks_for_lines_or_none_gets_no_hard_edges(crease):
    assert creases(refined([spindle("hard rim")], crease=crease)) == [0, 0, 0]


def test_models_that_keep_no_lines_keep_no_hard_edges():
    assert creases(refined([spindle("hard rim")], model=load_model("paper"))) == [0, 0, 0]
    assert creases(refined([spindle("hard rim")], scheme="loop")) == [0, 0, 0]


def test_a_line_is_kept_however_it_is_shaded():
    assert creases(refined([smooth_box()])) == creases(refined([box()])) == [12, 24, 0]


def test_lines_and_hard_edges_of_one_mesh_are_kept_side_by_side():
    apart = smooth_box()
    apart["POSITION"] = apart["POSITION"] + np.float32([4, 0, 0])
    assert creases(refined([spindle("hard rim", 48), apart])) == [48 + 12, 2 * (48 + 12), 0]


def test_meshes_of_one_file_are_each_asked_for_themselves():
    shadings = ["flat", "hard rim", "smooth", "hard rim", "flat"]
    result = refined(*([spindle(shading)] for shading in shadings))
    assert [creases(result, mesh)[0] for mesh in range(5)] == [0, 12, 0, 12, 0]
    for number, shading in enumerate(shadings):
        alone = files.primitive_of(refined([spindle(shading)]).glb)
        faces, attributes = files.primitive_of(result.glb, mesh=number)
        np.testing.assert_array_equal(faces, alone[0])
        for name, values in alone[1].items():
            np.testing.assert_array_equal(attributes[name], values)


def test_a_primitive_without_normals_says_nothing():
    bare = spindle("hard rim")
    del bare["NORMAL"]
    assert creases(refined([bare])) == [0, 0, 0]


@pytest.mark.parametrize("length", [0.0, 1.01])
def test_a_smooth_mesh_stays_so_whose_faces_carry_normals_of_other_lengths_or_of_none(length):
    shape = spindle("smooth")
    # Some faces get rows of their own.
    own = shape["indices"][::5].reshape(-1)
    faces = shape["indices"].copy()
    faces[::5] = len(shape["POSITION"]) + np.arange(len(own)).reshape(-1, 3)
    rows = {
        "POSITION": np.concatenate([shape["POSITION"], shape["POSITION"][own]]),
        "NORMAL": np.concatenate([shape["NORMAL"], np.float32(length) * shape["NORMAL"][own]]),
    }
    assert creases(refined([rows | {"indices": faces}])) == [0, 0, 0]


def test_artists_shade_hard_what_the_shape_shows_to_be_a_line():
    """Lines know positions alone, and artists' normals are another's word on the same edges."""
    lines, hard = np.zeros(2), np.zeros(2)
    for control in control_meshes(shared_path("assets")):
        meant = {tuple(edge) for edge in hard_edges(control, control.cleaned).tolist()}
        for gentle, edged in ((0, False), (1, None)):
            mesh = control.cleaned.mesh
            named = map(tuple, named_on(mesh, replace(LINES, edged=edged)).named.tolist())
            # Those that are held lie in a plane.
            turn = set(named) & {tuple(edge) for edge in edges_that_turn(mesh).tolist()}
            lines[gentle] += len(turn)
            hard[gentle] += len(turn & meant)
    assert lines[0] > 1000
    assert hard[0] > 0.99 * lines[0]
    # The gentler edges of edged meshes are few, and seven in eight were meant, too.
    assert lines[1] > lines[0] + 50
    assert hard[1] - hard[0] > 7 / 8 * (lines[1] - lines[0])


def edges_that_turn(mesh):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals, cosine = face_normals(mesh.vertices, mesh.faces), cosine_of(IN_ONE_PLANE)
    return topology.edges[edges_beyond(normals, topology, topology.interior, cosine)]


def nut(shading):
    """A prism of six sides, whose walls turn by 60 degrees, and its rims by 90."""
    angle = 2 * np.pi * np.arange(6) / 6
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    corners = np.concatenate([np.c_[ring, -np.ones(6)], np.c_[ring, np.ones(6)]])
    k, after = np.arange(6), (np.arange(6) + 1) % 6
    walls = np.concatenate([np.c_[k, after, 6 + after], np.c_[k, 6 + after, 6 + k]])
    fan = np.stack([0 * k[2:], k[1:-1], k[2:]], axis=1)
    faces = np.concatenate([walls, fan[:, ::-1], fan + 6])
    a, b, c = corners[faces].transpose(1, 0, 2)
    normals = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    points = corners[faces].reshape(-1, 3)
    if shading == "hard rims":
        on_walls = np.arange(len(points)) < 3 * len(walls)
        normals[on_walls] = points[on_walls] * [1, 1, 0]
    elif shading == "smooth":
        normals = points
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    indices = np.arange(len(points))
    return {"POSITION": np.float32(points), "NORMAL": np.float32(normals), "indices": indices}


@pytest.mark.parametrize(("shading", "kept"), [("flat", 24), ("smooth", 24), ("hard rims", 12)])
def test_who_shades_a_wall_smooth_between_hard_rims_means_it_round(shading, kept):
    """The diagonals of its ends, three each, are held where their corners are."""
    assert creases(refined([nut(shading)]))[0] == kept
    # Beside others, each mesh by itself.
    both = refined([nut(shading)], [smooth_box()], [nut("flat")])
    assert [creases(both, mesh)[0] for mesh in range(3)] == [kept, 12, 24]
