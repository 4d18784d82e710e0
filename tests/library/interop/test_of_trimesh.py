"""A trimesh.Trimesh comes back as one, with all that it carries."""

import numpy as np
import pytest

from pns_common import Mesh, ParameterError, loop, refine, subdivide
from tests.support.split_data import FACES, SCHEME, UV, VERTICES, same_surface, split_uv

trimesh = pytest.importorskip("trimesh")
NUMBERS = np.arange(len(FACES))


def given(**options):
    return trimesh.Trimesh(VERTICES, FACES, process=False, **options)


def test_the_surface_its_attributes_and_metadata():
    attributes = {"vertex_attributes": {"uv": UV}, "face_attributes": {"id": NUMBERS}}
    mesh = given(metadata={"name": "a part"}, **attributes)
    refined = subdivide(mesh, 2, SCHEME)
    same_surface(refined.vertices, refined.faces)
    assert refined.metadata == mesh.metadata
    assert refined.metadata is not mesh.metadata
    np.testing.assert_allclose(refined.vertex_attributes["uv"], split_uv(UV), atol=1e-12)
    np.testing.assert_array_equal(refined.face_attributes["id"], np.repeat(NUMBERS, 16))
    # None is made up.
    assert "density" not in refined._data
    mesh.density = 7.5
    assert subdivide(mesh, 1, SCHEME).density == 7.5


def test_levels_may_be_a_small_number_of_numpy_s():
    refined = subdivide(given(face_attributes={"face": NUMBERS}), np.uint8(4))
    np.testing.assert_array_equal(refined.face_attributes["face"], np.repeat(NUMBERS, 4**4))


def test_texture_coordinates_material_and_colours():
    material = trimesh.visual.material.SimpleMaterial(diffuse=[9, 8, 7, 255])
    visual = trimesh.visual.TextureVisuals(uv=UV, material=material)
    textured = subdivide(given(visual=visual), 2, SCHEME).visual
    np.testing.assert_allclose(textured.uv, split_uv(UV), atol=1e-12)
    assert textured.material.diffuse.tolist() == [9, 8, 7, 255]
    colours = np.column_stack([np.arange(len(FACES)) % 256] * 4).astype(np.uint8)
    own = colours[: len(VERTICES)]
    refined = subdivide(given(vertex_colors=own), 2, SCHEME)
    assert np.abs(refined.visual.vertex_colors - split_uv(own.astype(float))).max() <= 1.5
    refined = subdivide(given(face_colors=colours), 2, SCHEME)
    np.testing.assert_array_equal(refined.visual.face_colors, np.repeat(colours, 16, axis=0))


def test_a_seam_of_the_texture_is_no_boundary():
    apart = np.arange(3 * len(FACES)).reshape(-1, 3)
    seam = trimesh.Trimesh(VERTICES[FACES].reshape(-1, 3), apart, process=False)
    whole = refine(Mesh(VERTICES, FACES), loop(), 2).mesh
    area = trimesh.Trimesh(whole.vertices, whole.faces).area
    assert np.isclose(subdivide(seam, 2, loop()).area, area)


def test_a_primitive_becomes_a_mesh_and_a_class_of_the_users_own_stays():
    class Part(trimesh.Trimesh):
        pass

    assert type(subdivide(Part(VERTICES, FACES), scheme=loop())) is Part
    box = trimesh.primitives.Box(extents=(1, 2, 3))
    box.metadata["name"] = "a box"
    refined = subdivide(box, 2, SCHEME)
    assert type(refined) is trimesh.Trimesh
    assert refined.metadata["name"] == "a box"
    alone = refine(Mesh(box.vertices, box.faces), SCHEME, 2).mesh
    np.testing.assert_array_equal(refined.vertices, alone.vertices)
    np.testing.assert_array_equal(refined.faces, alone.faces)


def test_a_scene_keeps_its_graph_and_what_has_no_faces():
    scene = trimesh.Scene()
    scene.add_geometry(given(), geom_name="blob", transform=np.diag([2.0, 2, 2, 1]))
    scene.add_geometry(trimesh.PointCloud(VERTICES), geom_name="cloud")
    scene.add_geometry(trimesh.Trimesh(vertices=np.eye(3)), geom_name="bare")
    refined = subdivide(scene, 2, SCHEME)
    blob = refined.geometry["blob"]
    same_surface(blob.vertices, blob.faces)
    np.testing.assert_array_equal(refined.geometry["cloud"].vertices, VERTICES)
    assert len(refined.geometry["bare"].faces) == 0
    assert len(scene.geometry["blob"].faces) == len(FACES)
    np.testing.assert_allclose(refined.bounds, scene.bounds, atol=0.5)


def test_creases_are_named_as_on_the_command_line_and_quads_are_refused():
    box = trimesh.creation.box()
    for options in ({"crease": "off"}, {"creases": "off"}, {"crease": None}):
        made = subdivide(box, 1, "loop", **options)
        expected = refine(Mesh(box.vertices, box.faces), "loop", 1, creases=None).mesh
        np.testing.assert_array_equal(made.vertices, expected.vertices)
    with pytest.raises(ParameterError, match="holds no quads"):
        subdivide(box, 1, "catmull-clark")
