"""Positions, attributes and seams of a refined asset."""

import numpy as np
import pytest

from pns_common.mesh.mesh import Mesh
from pns_common.operator.scheme import loop
from pns_common.refinement import refine
from service.meshes.weld import weld
from tests.service.gltf.subdivided import corner_positions, subdivide
from tests.support.gltf import files
from tests.support.gltf.shapes import box, octahedron


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("shape", [box, octahedron])
def test_positions_are_the_welded_mesh_refined(shape, levels):
    primitive = shape()
    welded = weld(primitive["POSITION"], primitive["indices"].astype(np.int64))
    expected = refine(Mesh(welded.points, welded.faces), loop(), levels).mesh
    actual = corner_positions(subdivide([primitive], levels=levels).glb)
    np.testing.assert_array_equal(actual, expected.vertices[expected.faces].astype(np.float32))


@pytest.mark.parametrize("levels", [1, 2])
def test_texture_coordinates_are_linear_in_each_face(levels):
    _, attributes = files.primitive_of(subdivide([box()], levels=levels).glb)
    faces, _ = files.primitive_of(subdivide([box()], levels=levels).glb)
    # On each side of the box the UVs stay the regular grid.
    steps = attributes["TEXCOORD_0"] * 2**levels
    np.testing.assert_array_equal(steps, np.rint(steps))
    # One vertex a distinct corner: each side is a grid of (n + 1)² vertices.
    assert len(attributes["POSITION"]) == 6 * (2**levels + 1) ** 2
    assert faces.max() == len(attributes["POSITION"]) - 1


def test_normals_are_unit_and_hard_edges_stay_hard():
    faces, attributes = files.primitive_of(subdivide([box()], levels=2).glb)
    normals, points = attributes["NORMAL"], attributes["POSITION"]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    corners = points[faces].astype(np.float64)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fci->fc", flat, normals[faces]) > 0).all()
    # Along an edge of the box the two sides keep normals of their own.
    vertex = weld(points, faces).vertex_of
    counts = [
        len(np.unique(normals[vertex == v].round(5), axis=0)) for v in range(vertex.max() + 1)
    ]
    assert sorted(set(counts)) == [1, 2, 3]
    assert counts.count(3) == 8
    assert counts.count(2) == 12 * 3


def test_normals_are_smooth_across_primitives():
    shape = octahedron()
    shape["NORMAL"] = shape["POSITION"]
    halves = [
        {**shape, "indices": shape["indices"][:4]},
        {**shape, "indices": shape["indices"][4:]},
    ]
    result = subdivide(halves, levels=2).glb
    parts = [files.primitive_of(result, 0, number)[1] for number in (0, 1)]
    normal_at = {}
    for part in parts:
        for point, normal in zip(part["POSITION"].tolist(), part["NORMAL"], strict=True):
            np.testing.assert_array_equal(normal_at.setdefault(tuple(point), normal), normal)
    # A round shape: normals point outwards.
    for part in parts:
        assert (np.einsum("vi,vi->v", part["POSITION"], part["NORMAL"]) > 0).all()


def test_tangents_are_perpendicular_units_with_their_handedness():
    shape = box()
    shape["TANGENT"] = shape["TANGENT"] * np.where(np.arange(24) < 12, 1, -1)[:, None]
    _, attributes = files.primitive_of(subdivide([shape], levels=2).glb)
    tangents, normals = attributes["TANGENT"], attributes["NORMAL"]
    np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(np.einsum("vi,vi->v", tangents[:, :3], normals), 0, atol=1e-6)
    assert np.unique(tangents[:, 3], return_counts=True)[1].tolist() == [75, 75]


def test_a_face_whose_corners_differ_in_handedness_keeps_either():
    shape = box()
    shape["TANGENT"] = shape["TANGENT"] * np.where(np.arange(24) % 4 == 0, 1, -1)[:, None]
    _, attributes = files.primitive_of(subdivide([shape], levels=2).glb)
    assert set(attributes["TANGENT"][:, 3].tolist()) == {-1, 1}


def test_useless_normals_and_tangents_become_unit_vectors():
    # Zeros in the file, and faces that cancel out: there is still a normal at every vertex.
    shape = octahedron()
    shape["NORMAL"], shape["TANGENT"] = np.zeros((6, 3)), np.zeros((6, 4))
    shape["TANGENT"][:, 3] = 1
    shape["indices"] = np.concatenate([shape["indices"], shape["indices"][:, ::-1]])
    _, attributes = files.primitive_of(subdivide([shape]).glb)
    for name in ("NORMAL", "TANGENT"):
        lengths = np.linalg.norm(attributes[name][:, :3], axis=1)
        np.testing.assert_allclose(lengths, 1, atol=1e-6)
    del shape["NORMAL"]
    _, attributes = files.primitive_of(subdivide([shape], normals="keep").glb)
    assert set(map(tuple, attributes["TANGENT"].tolist())) == {(0, 0, 1, 1)}


@pytest.mark.parametrize(("dtype", "full"), [(np.uint8, 255), (np.uint16, 65535)])
@pytest.mark.parametrize("width", [3, 4])
def test_integer_colours_are_averaged_and_keep_their_type(dtype, full, width):
    colours = np.zeros((6, width), dtype=dtype)
    colours[0] = full
    shape = octahedron(COLOR_0=files.Normalized(colours))
    result = subdivide([shape]).glb
    tree, _ = files.unpack(result)
    index = tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    assert tree["accessors"][index]["normalized"] is True
    _, attributes = files.primitive_of(result)
    assert attributes["COLOR_0"].dtype == dtype
    values, counts = np.unique(attributes["COLOR_0"][:, 0], return_counts=True)
    assert values.tolist() == [0, (full + 1) // 2, full]
    assert counts.tolist() == [13, 4, 1]


def test_float_colours_and_custom_attributes_are_linear():
    rng = np.random.default_rng(0)
    colours, heat = rng.random((6, 4)), rng.random((6, 1))
    shape = octahedron(COLOR_0=colours, _HEAT=heat)
    faces, attributes = files.primitive_of(subdivide([shape]).glb)
    for name, values in (("COLOR_0", colours), ("_HEAT", heat)):
        corners = values[shape["indices"]]
        middle = (corners + np.roll(corners, -1, axis=1)) / 2
        centre_children = attributes[name][faces[3::4]]
        np.testing.assert_allclose(centre_children, middle, atol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int8, np.int16, np.uint32, np.float32])
def test_identifiers_are_copied_from_a_nearest_corner(dtype):
    ids = np.arange(10, 16).astype(dtype)[:, None]
    # Beside three bytes of padding, which must not leak into the values.
    faces, attributes = files.primitive_of(subdivide([octahedron(_FEATURE_ID_0=ids)]).glb)
    refined = attributes["_FEATURE_ID_0"]
    assert refined.dtype == dtype
    corner = refined[faces[:, 0]].reshape(-1, 4)[:, :3]
    np.testing.assert_array_equal(corner, ids[octahedron()["indices"], 0])
    assert set(refined[:, 0].tolist()) == set(range(10, 16))


@pytest.mark.parametrize("levels", [1, 3])
def test_floats_that_number_features_are_copied_too(levels):
    # No accessor of vertices holds integers of 32 bits: these are exact up to 2**24.
    ids = 2.0**24 - 7 * np.arange(6)[:, None]
    shape = octahedron(_FEATURE_ID_12=ids, _BATCHID=ids, _HEAT=ids - ids.mean())
    _, attributes = files.primitive_of(subdivide([shape], levels=levels).glb)
    for name in ("_FEATURE_ID_12", "_BATCHID"):
        assert set(attributes[name][:, 0].tolist()) == set(ids[:, 0].tolist())
    assert len(np.unique(attributes["_HEAT"])) > 6


def test_a_seam_in_any_attribute_splits_vertices_and_not_the_surface():
    shape = octahedron()
    flat = shape["indices"].reshape(-1)
    # Every face its own colour: nothing but the position is shared.
    loose = {
        "POSITION": shape["POSITION"][flat],
        "COLOR_0": np.repeat(np.linspace(0, 1, 8), 3)[:, None] * np.ones(3),
    }
    faces, attributes = files.primitive_of(subdivide([loose]).glb)
    assert len(attributes["POSITION"]) == 8 * 6
    np.testing.assert_array_equal(
        attributes["POSITION"][faces], corner_positions(subdivide([shape]).glb)
    )
