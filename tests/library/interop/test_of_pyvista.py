"""A pyvista.PolyData comes back as one, with all that it carries."""

import numpy as np
import pytest

from pns_common import Mesh, MeshError, catmull_clark, loop, refine, subdivide
from tests.support.polygons import cylinder
from tests.support.split_data import FACES, SCHEME, UV, VERTICES, same_surface, split_uv


class TestPyvista:
    pyvista = pytest.importorskip("pyvista")

    def mesh(self):
        mesh = self.pyvista.PolyData.from_regular_faces(VERTICES, FACES)
        mesh.point_data["x"] = VERTICES[:, 0]
        mesh.point_data["velocity"] = VERTICES
        mesh.cell_data["part"] = np.arange(len(FACES))
        mesh.field_data["made by"] = ["a test"]
        mesh.active_texture_coordinates = UV
        return mesh

    def test_the_surface_and_its_data(self):
        given = self.mesh()
        given.set_active_scalars("x")
        refined = subdivide(given, 2, SCHEME)
        same_surface(refined.points, refined.regular_faces)
        data = split_uv(VERTICES)
        np.testing.assert_allclose(refined["velocity"], data, atol=1e-12)
        np.testing.assert_allclose(refined["x"], data[:, 0], atol=1e-12)
        np.testing.assert_array_equal(refined["part"], np.repeat(np.arange(len(FACES)), 16))
        np.testing.assert_allclose(refined.active_texture_coordinates, split_uv(UV), atol=1e-6)
        assert refined.active_scalars_name == "x"
        assert list(refined.field_data["made by"]) == ["a test"]

    def test_normals_of_the_old_surface_are_left_out(self):
        refined = subdivide(self.mesh().compute_normals(), 1, loop())
        assert "Normals" not in refined.point_data
        assert "Normals" not in refined.cell_data

    def test_a_plane_of_quadrangles_becomes_quads_with_its_data(self):
        plane = self.pyvista.Plane(i_resolution=3, j_resolution=2)
        plane.point_data["x"] = plane.points[:, 0]
        plane.cell_data["cell"] = np.arange(6)
        refined = subdivide(plane, 2)
        assert refined.regular_faces.shape == (6 * 16, 4)
        assert refined.cell_data["cell"].tolist() == np.repeat(np.arange(6), 16).tolist()
        inside = np.abs(refined.points[:, :2]).max(axis=1) < 0.1
        np.testing.assert_allclose(refined["x"][inside], refined.points[inside, 0], atol=0.05)

    def test_faces_of_many_sizes_become_quads(self):
        points, faces = cylinder(6)
        padded = np.concatenate([[len(face), *face] for face in faces])
        refined = subdivide(self.pyvista.PolyData(points, padded), 1, "catmull-clark")
        expected = refine(Mesh(points, faces), catmull_clark(), 1).mesh
        np.testing.assert_allclose(refined.points, expected.vertices, atol=1e-6)
        np.testing.assert_array_equal(refined.regular_faces, expected.faces)

    def test_lines_and_points_beside_triangles_are_refused_with_what_to_do(self):
        """To triangulate it does not help: lines are still there."""
        both = {"lines": [2, 0, 1], "verts": [1, 0]}
        given = self.pyvista.PolyData(VERTICES, faces=self.mesh().faces, **both)
        for refused in (given, given.triangulate()):
            with pytest.raises(MeshError, match=r"lines \(1\)") as told:
                subdivide(refused)
        advice = str(told.value).split("give ")[1]
        followed = eval(advice, {"pyvista": self.pyvista, "mesh": given})
        assert subdivide(followed, 1, loop()).n_cells == 4 * len(FACES)

    def test_a_cloud_of_points_is_refused_as_one_without_faces(self):
        for cloud in (self.pyvista.PolyData(), self.pyvista.PolyData(VERTICES)):
            with pytest.raises(MeshError, match="no faces"):
                subdivide(cloud)

    def test_blocks_keep_their_names_and_what_is_no_surface(self):
        inner = self.pyvista.MultiBlock({"blob": self.mesh(), "none": None})
        blocks = self.pyvista.MultiBlock({"inner": inner, "grid": self.pyvista.ImageData()})
        refined = subdivide(blocks, 2, SCHEME)
        assert refined.keys() == ["inner", "grid"]
        same_surface(refined["inner"]["blob"].points, refined["inner"]["blob"].regular_faces)
        assert refined["inner"]["none"] is None
        assert blocks["inner"]["blob"].n_cells == len(FACES)

    def test_polygons_are_cut_with_their_data(self):
        plane = self.pyvista.Plane(i_resolution=2, j_resolution=1)
        plane.cell_data["side"] = [0, 1]
        refined = subdivide(plane, 1, SCHEME, triangulate=True)
        assert refined.cell_data["side"].tolist() == [0] * 8 + [1] * 8

    @pytest.mark.parametrize("place", ["point_data", "cell_data"])
    def test_what_is_active_stays_active(self, place):
        given = self.mesh()
        given.cell_data["force"] = np.ones((len(FACES), 3))
        given.cell_data["heat"] = np.arange(len(FACES)) / 2.0
        where = place.removesuffix("_data")
        vectors, scalars = {"point": ("velocity", "x"), "cell": ("force", "heat")}[where]
        given.set_active_vectors(vectors, preference=where)
        given.set_active_scalars(scalars, preference=where)
        refined = subdivide(given, 1, SCHEME)
        assert refined.active_vectors_info[:] == given.active_vectors_info[:]
        assert refined.active_scalars_info[:] == given.active_scalars_info[:]
        assert getattr(refined, place).active_scalars_name == scalars

    def test_parts_without_faces_stay_in_a_collection(self):
        line, cloud = self.pyvista.Line(), self.pyvista.PolyData(np.eye(3))
        nested = self.pyvista.MultiBlock([self.mesh(), line, cloud])
        given = self.pyvista.MultiBlock([nested, None, self.mesh()])
        refined = subdivide(given, 1, SCHEME)
        counts = [0 if block is None else block.n_points for block in refined[0]]
        assert counts[1:] == [2, 3]
        assert refined[0][0].n_cells == refined[2].n_cells == 4 * len(FACES)
        assert refined[1] is None
        with pytest.raises(MeshError, match="no faces"):
            subdivide(line, 1, SCHEME)
