"""Normals that say what the faces around do not go on; what exporters average is made anew."""

import numpy as np
import pytest

from pns_common import load_model
from pns_common.mesh.normals import opposed_corners
from pns_common.parallel import Blocks
from service.gltf.refine.normals import own_shares
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.shared import shared_path


def subdivide(*meshes, **options):
    options = Options(**{"scheme": "loop", "levels": 1, **options})
    return subdivide_gltf(files.glb(*meshes), "glb", options, None, Limits()).glb


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def sheet(height=0.0):
    """A sheet of 4 × 4 squares from (-1, -1) to (1, 1), bent by a height."""
    x, y = (side.reshape(-1) for side in np.meshgrid(*[np.linspace(-1, 1, 5)] * 2, indexing="ij"))
    corner = (np.arange(4)[:, None] * 5 + np.arange(4)).reshape(-1, 1)
    faces = np.concatenate([np.add(corner, [0, 5, 1]), np.add(corner, [1, 5, 6])])
    points = np.column_stack([x, y, height * (x * x + y * y + 0.7 * x * x * y)])
    return {"POSITION": points, "indices": faces}


def averaged(shape, weights):
    """Return a normal for each vertex as exporters make it: the weighted mean of its faces'."""
    normals = np.zeros((len(shape["POSITION"]), 3))
    for face in shape["indices"]:
        corners = shape["POSITION"][face]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normals[face] += weights(normal)
    return unit(normals)


def test_what_lies_within_ten_degrees_of_its_faces_says_nothing_of_its_own():
    angles = np.radians([0.0, 9.9, 10.1, 19.9, 20.1, 90.0, 180.0])
    given = np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)]) * 3
    shares = own_shares(given, np.tile([0.0, 0, 1], (7, 1)))
    assert shares[[0, 1]].tolist() == [0, 0]
    assert 0 < shares[2] < 0.02
    assert 0.98 < shares[3] < 1
    assert shares[4:].tolist() == [1, 1, 1]


@pytest.mark.parametrize("levels", [1, 3])
def test_a_sheet_that_is_lit_as_a_ball_stays_so(levels):
    # As foliage is: its normals lead away from a point that lies aside, 25 degrees and more.
    shape = sheet()
    normals = unit(shape["POSITION"] - [2.5, 0, -1.5])
    faces, after = files.primitive_of(subdivide([{**shape, "NORMAL": normals}], levels=levels))
    corners = faces.reshape(len(shape["indices"]), -1, 3)
    # The first descendant's first corner is an old vertex, and stays as it was.
    np.testing.assert_allclose(
        after["NORMAL"][corners[:, 0, 0]], normals[shape["indices"][:, 0]], atol=1e-6
    )
    if levels == 1:
        at = normals[shape["indices"]]
        middles = unit(at + np.roll(at, -1, axis=1))
        np.testing.assert_allclose(after["NORMAL"][corners[:, 3]], middles, atol=1e-6)


def test_a_morph_target_moves_such_normals_as_its_file_does():
    shape = sheet()
    normals = unit(shape["POSITION"] - [2.5, 0, -1.5])
    turned = unit(shape["POSITION"] - [0, 2.5, -1.5])
    target = {"POSITION": 0.1 * shape["POSITION"], "NORMAL": turned - normals}
    data = subdivide([{**shape, "NORMAL": normals, "targets": [target]}])
    faces, after = files.primitive_of(data)
    (moved,) = files.targets_of(data)
    at_weight_one = (after["NORMAL"] + moved["NORMAL"])[faces[::4, 0]]
    np.testing.assert_allclose(at_weight_one, turned[shape["indices"][:, 0]], atol=1e-6)


def test_normals_averaged_by_area_or_evenly_are_made_anew_alike():
    shape = sheet(0.15)
    made = [
        files.primitive_of(subdivide([{**shape, "NORMAL": averaged(shape, weights)}], levels=2))[1]
        for weights in (lambda normal: normal, unit)
    ]
    np.testing.assert_array_equal(made[0]["NORMAL"], made[1]["NORMAL"])


@pytest.mark.parametrize("levels", [1, 3])
def test_no_seam_is_seen_where_two_meshes_meet_that_were_shaded_as_one(levels):
    whole = sheet(0.5)
    points, normals = whole["POSITION"], averaged(whole, lambda normal: normal)
    left = points[whole["indices"]].mean(axis=1)[:, 0] < 0
    halves = [
        {"POSITION": points, "NORMAL": normals, "indices": whole["indices"][side]}
        for side in (left, ~left)
    ]
    data = subdivide(*([half] for half in halves), levels=levels)
    made = [files.primitive_of(data, mesh)[1] for mesh in (0, 1)]
    one, other = (
        dict(zip(map(tuple, each["POSITION"].tolist()), each["NORMAL"], strict=True))
        for each in made
    )
    # But near its ends, which are corners of both.
    border = one.keys() & other.keys()
    assert len(border) > 2 * 2**levels
    for place in border:
        np.testing.assert_allclose(one[place], other[place], atol=1e-6)


def folding():
    """A flat square with thin triangles, some of whose children turn over under Loop's rules."""
    x = [0, 1, 1, 0, 0.51, 0.14, 0.31]
    y = [0, 0, 1, 1, 0.95, 0.95, 0.42]
    faces = [2, 6, 1, 1, 6, 0, 6, 3, 0, 3, 4, 2, 4, 6, 2, 6, 5, 3, 5, 4, 3, 4, 5, 6]
    points = np.column_stack([x, y, np.zeros(7)])
    up, along = np.tile([0.0, 0, 1], (7, 1)), np.tile([1.0, 0, 0, 1], (7, 1))
    faces = np.array(faces).reshape(-1, 3)
    return {"POSITION": points, "NORMAL": up, "TANGENT": along, "indices": faces}


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("normals", ["keep", "smooth"])
def test_where_a_flat_side_folds_each_face_has_its_own_front(normals, copies):
    data = subdivide(*[[folding()]] * copies, levels=2, normals=normals)
    for mesh in range(copies):
        faces, after = files.primitive_of(data, mesh)
        a, b, c = np.moveaxis(after["POSITION"][faces.reshape(-1, 3)], 1, 0)
        front = np.sign(np.cross(b - a, c - a)[:, 2])
        assert (front < 0).any()
        made = after["NORMAL"][faces.reshape(-1, 3)]
        np.testing.assert_allclose(made[..., 2], np.tile(front[:, None], 3), atol=1e-6)
        # The frame's third direction stays as it was.
        tangents = after["TANGENT"][faces.reshape(-1, 3)]
        third = np.cross(made, tangents[..., :3]) * tangents[..., 3:]
        np.testing.assert_allclose(third, np.broadcast_to([0, 1, 0], third.shape), atol=1e-6)


def test_normals_that_pointed_away_before_are_their_author_s():
    shape = folding()
    down = {**shape, "NORMAL": -shape["NORMAL"]}
    _, after = files.primitive_of(subdivide([down], levels=2))
    np.testing.assert_allclose(after["NORMAL"][:, 2], -1, atol=1e-6)


def test_no_normal_of_the_knight_points_away():
    data = shared_path("assets/Knight.glb").read_bytes()
    for normals in ("keep", "smooth"):
        options = Options(levels=2, normals=normals)
        result = subdivide_gltf(data, "glb", options, load_model(), Limits())
        assert not [c for c in result.report["changes"] if "points away" in c["what"]]
        tree, _ = files.unpack(result.glb)
        for mesh in range(len(tree["meshes"])):
            faces, after = files.primitive_of(result.glb, mesh)
            corners = after["POSITION"], after["NORMAL"], faces.reshape(-1, 3)
            assert not opposed_corners(*corners, Blocks()).any()
