"""A trimesh.Trimesh comes back as one, with all that it carries."""

import numpy as np
import pytest

from pns_common import Mesh, loop, refine, subdivide
from tests.support.split_data import FACES, SCHEME, UV, VERTICES, same_surface, split_uv


class TestTrimesh:
    trimesh = pytest.importorskip("trimesh")

    def mesh(self, **options):
        return self.trimesh.Trimesh(VERTICES, FACES, process=False, **options)

    def test_the_surface_and_metadata(self):
        given = self.mesh(metadata={"name": "a part"})
        refined = subdivide(given, 2, SCHEME)
        same_surface(refined.vertices, refined.faces)
        assert refined.metadata == given.metadata
        assert refined.metadata is not given.metadata

    def test_a_primitive_becomes_a_mesh(self):
        given = self.trimesh.primitives.Box(extents=(1, 2, 3))
        given.metadata["name"] = "a box"
        refined = subdivide(given, 2, SCHEME)
        assert type(refined) is self.trimesh.Trimesh
        assert refined.metadata["name"] == "a box"
        alone = refine(Mesh(given.vertices, given.faces), SCHEME, 2).mesh
        np.testing.assert_array_equal(refined.vertices, alone.vertices)
        np.testing.assert_array_equal(refined.faces, alone.faces)

    def test_levels_may_be_a_small_number_of_numpy_s(self):
        refined = subdivide(self.mesh(face_attributes={"face": np.arange(len(FACES))}), np.uint8(4))
        np.testing.assert_array_equal(
            refined.face_attributes["face"], np.repeat(np.arange(len(FACES)), 4**4)
        )

    def test_texture_coordinates_and_material(self):
        material = self.trimesh.visual.material.SimpleMaterial(diffuse=[9, 8, 7, 255])
        visual = self.trimesh.visual.TextureVisuals(uv=UV, material=material)
        refined = subdivide(self.mesh(visual=visual), 2, SCHEME)
        np.testing.assert_allclose(refined.visual.uv, split_uv(UV), atol=1e-12)
        assert refined.visual.material.diffuse.tolist() == [9, 8, 7, 255]

    def test_a_seam_of_the_texture_is_no_boundary(self):
        seam = self.trimesh.Trimesh(
            VERTICES[FACES].reshape(-1, 3),
            process=False,
            faces=np.arange(3 * len(FACES)).reshape(-1, 3),
        )
        refined = subdivide(seam, 2, loop())
        whole = refine(Mesh(VERTICES, FACES), loop(), 2).mesh
        assert np.isclose(refined.area, self.trimesh.Trimesh(whole.vertices, whole.faces).area)

    def test_colours_of_vertices_and_of_faces(self):
        colours = np.column_stack([np.arange(len(VERTICES)) % 256] * 4).astype(np.uint8)
        refined = subdivide(self.mesh(vertex_colors=colours), 2, SCHEME)
        assert np.abs(refined.visual.vertex_colors - split_uv(colours.astype(float))).max() <= 1.5
        colours = np.column_stack([np.arange(len(FACES)) % 256] * 4).astype(np.uint8)
        refined = subdivide(self.mesh(face_colors=colours), 2, SCHEME)
        np.testing.assert_array_equal(refined.visual.face_colors, np.repeat(colours, 16, axis=0))

    def test_attributes(self):
        given = self.mesh(
            vertex_attributes={"uv": UV}, face_attributes={"id": np.arange(len(FACES))}
        )
        refined = subdivide(given, 2, SCHEME)
        np.testing.assert_allclose(refined.vertex_attributes["uv"], split_uv(UV), atol=1e-12)
        np.testing.assert_array_equal(
            refined.face_attributes["id"], np.repeat(np.arange(len(FACES)), 16)
        )

    def test_a_class_of_the_users_own(self):
        class Part(self.trimesh.Trimesh):
            pass

        assert type(subdivide(Part(VERTICES, FACES), scheme=loop())) is Part

    def test_a_scene_keeps_its_graph_and_what_is_no_mesh(self):
        scene = self.trimesh.Scene()
        scene.add_geometry(self.mesh(), geom_name="blob", transform=np.diag([2.0, 2, 2, 1]))
        scene.add_geometry(self.trimesh.PointCloud(VERTICES), geom_name="cloud")
        refined = subdivide(scene, 2, SCHEME)
        blob = refined.geometry["blob"]
        same_surface(blob.vertices, blob.faces)
        np.testing.assert_array_equal(refined.geometry["cloud"].vertices, VERTICES)
        assert len(scene.geometry["blob"].faces) == len(FACES)
        np.testing.assert_allclose(refined.bounds, scene.bounds, atol=0.5)

    def test_a_density_stays_and_none_is_made_up(self):
        given = self.mesh()
        assert "density" not in subdivide(given, 1, SCHEME)._data
        given.density = 7.5
        assert subdivide(given, 1, SCHEME).density == 7.5

    def test_parts_of_a_scene_without_faces_stay(self):
        scene = self.trimesh.Scene(
            {"part": self.mesh(), "cloud": self.trimesh.PointCloud(np.eye(3))}
        )
        scene.add_geometry(self.trimesh.Trimesh(vertices=np.eye(3)), geom_name="bare")
        refined = subdivide(scene, 1, SCHEME)
        assert len(refined.geometry["part"].faces) == 4 * len(FACES)
        assert len(refined.geometry["cloud"].vertices) == 3
        assert len(refined.geometry["bare"].faces) == 0
