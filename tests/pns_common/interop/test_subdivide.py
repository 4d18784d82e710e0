"""What `subdivide` is given, it gives back: each kind of mesh with the library that made it."""

import subprocess
import sys

import numpy as np
import pytest

from pns_common import Mesh, MeshError, ParameterError, load_model, loop, pns, refine, subdivide
from tests.support.meshes import bumpy_sphere

VERTICES, FACES = bumpy_sphere()
SCHEME = pns(load_model("paper"))
EXPECTED = refine(Mesh(VERTICES, FACES), SCHEME, 2).mesh
UV = VERTICES[:, :2] / 4 + 0.5


def split_uv(uv, levels=2):
    """Texture coordinates of the refined mesh, from the edges of each refined mesh in turn."""
    for level in range(levels):
        faces = refine(Mesh(VERTICES, FACES), loop(), level).mesh.faces if level else FACES
        made = refine(Mesh(VERTICES, FACES), loop(), level + 1).mesh.faces
        grown = np.empty((made.max() + 1, uv.shape[1]))
        grown[: len(uv)] = uv
        for corner, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)]):
            # The middle child of a face has its edge vertices as corners.
            grown[made[3::4][:, corner]] = (uv[faces[:, a]] + uv[faces[:, b]]) / 2
        uv = grown
    return uv


def same_surface(vertices, faces):
    np.testing.assert_allclose(vertices, EXPECTED.vertices, atol=1e-12)
    np.testing.assert_array_equal(faces, EXPECTED.faces)


def test_a_mesh():
    refined = subdivide(Mesh(VERTICES, FACES), 2, SCHEME)
    assert isinstance(refined, Mesh)
    same_surface(refined.vertices, refined.faces)


@pytest.mark.parametrize("kind", [tuple, list])
def test_a_pair_of_arrays(kind):
    refined = subdivide(kind((VERTICES, FACES)), 2, SCHEME)
    assert type(refined) is kind
    same_surface(*refined)
    refined[0][0] = 0  # the caller's own


def test_the_scheme_is_the_default_model_where_none_is_given():
    vertices, _ = subdivide((VERTICES, FACES), reference_length=1)
    expected = refine(Mesh(VERTICES, FACES), pns(load_model()), reference_length=1)
    np.testing.assert_array_equal(vertices, expected.mesh.vertices)


@pytest.mark.parametrize("mesh", [None, "part.glb", (VERTICES, FACES, FACES), VERTICES])
def test_other_things_are_refused_with_the_kinds_that_there_are(mesh):
    with pytest.raises(ParameterError, match=r"trimesh\.Trimesh"):
        subdivide(mesh)


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

    def test_the_accessor(self):
        import pns_common.pyvista  # noqa: F401  (it registers `mesh.pns`)

        refined = self.mesh().pns.subdivide(2, SCHEME)
        same_surface(refined.points, refined.regular_faces)
        smooth = refine(Mesh(VERTICES, FACES), loop(), 1).mesh
        np.testing.assert_allclose(self.mesh().pns.loop().points, smooth.vertices)

    def test_a_plane_of_quadrangles_is_refused_with_what_to_do(self):
        with pytest.raises(MeshError, match="triangulate"):
            subdivide(self.pyvista.Plane())


class TestMeshio:
    meshio = pytest.importorskip("meshio")

    def test_the_surface_its_blocks_and_their_data(self):
        blocks = [("triangle", FACES[:50]), ("triangle", FACES[50:])]
        part = [np.zeros(50), np.ones(len(FACES) - 50)]
        given = self.meshio.Mesh(
            VERTICES, blocks, {"uv": UV}, {"part": part}, field_data={"skin": [1, 2]}
        )
        refined = subdivide(given, 2, SCHEME)
        assert isinstance(refined, self.meshio.Mesh)
        same_surface(refined.points, np.concatenate([block.data for block in refined.cells]))
        assert [len(block.data) for block in refined.cells] == [800, 16 * (len(FACES) - 50)]
        assert [set(values) for values in refined.cell_data["part"]] == [{0.0}, {1.0}]
        np.testing.assert_allclose(refined.point_data["uv"], split_uv(UV), atol=1e-12)
        assert refined.field_data == given.field_data

    def test_a_plane_mesh_stays_plane(self):
        given = self.meshio.Mesh(np.array([[0.0, 0], [1, 0], [0, 1]]), [("triangle", [[0, 1, 2]])])
        assert subdivide(given, 2).points.shape == (15, 2)

    @pytest.mark.parametrize("cells", [[("quad", [[0, 1, 2, 3]])], []])
    def test_other_cells_are_refused_by_name(self, cells):
        with pytest.raises(MeshError, match=r"cells of type (quad|none)"):
            subdivide(self.meshio.Mesh(np.eye(4)[:, :3], cells))


class TestOpen3d:
    """open3d is large: where it is absent, these are left out."""

    @pytest.fixture
    def mesh(self):
        open3d = pytest.importorskip("open3d")
        vector, triples = open3d.utility.Vector3dVector, open3d.utility.Vector3iVector
        mesh = open3d.geometry.TriangleMesh(vector(VERTICES), triples(FACES.astype(np.int32)))
        mesh.vertex_colors = vector((VERTICES + 2) / 4)
        mesh.triangle_uvs = open3d.utility.Vector2dVector(UV[FACES].reshape(-1, 2))
        mesh.triangle_material_ids = open3d.utility.IntVector(np.arange(len(FACES), dtype=np.int32))
        mesh.textures = [open3d.geometry.Image(np.zeros((2, 2, 3), dtype=np.uint8))]
        return mesh

    def test_the_surface_and_its_data(self, mesh):
        refined = subdivide(mesh, 2, SCHEME)
        assert type(refined) is type(mesh)
        same_surface(np.asarray(refined.vertices), np.asarray(refined.triangles))
        colours = split_uv((VERTICES + 2) / 4)
        np.testing.assert_allclose(np.asarray(refined.vertex_colors), colours, atol=1e-12)
        uv = split_uv(UV)[EXPECTED.faces].reshape(-1, 2)
        np.testing.assert_allclose(np.asarray(refined.triangle_uvs), uv, atol=1e-12)
        materials = np.asarray(refined.triangle_material_ids)
        np.testing.assert_array_equal(materials, np.repeat(np.arange(len(FACES)), 16))
        assert len(refined.textures) == 1
        assert not refined.has_vertex_normals()

    def test_normals_are_computed_where_there_were_some(self, mesh):
        mesh.compute_vertex_normals()
        assert subdivide(mesh, 1, loop()).has_vertex_normals()
        mesh.vertex_normals.clear()
        refined = subdivide(mesh, 1, loop())
        assert refined.has_triangle_normals()
        assert not refined.has_vertex_normals()


def test_the_library_imports_none_of_the_others():
    code = "import sys, pns_common; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(done.stdout.split()) & {"trimesh", "pyvista", "meshio", "open3d", "vtk"}
