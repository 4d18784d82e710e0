"""Normals that say what the faces around do not go on; what exporters average is made anew."""

import numpy as np
import pytest

from service.gltf.refine.normals import own_shares
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files


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


def test_without_a_direction_or_a_face_there_is_nothing_to_say():
    assert own_shares(np.zeros((1, 3)), np.array([[0.0, 0, 1]])).tolist() == [0]
    assert own_shares(np.array([[0.0, 0, 1]]), np.zeros((1, 3))).tolist() == [0]


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
