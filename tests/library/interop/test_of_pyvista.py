"""A pyvista.PolyData comes back as one, with all that it carries; `mesh.pns` refines it too."""

import numpy as np
import pytest

from pns_common import Mesh, MeshError, catmull_clark, loop, refine, subdivide
from tests.support.polygons import cylinder
from tests.support.split_data import FACES, SCHEME, UV, VERTICES, same_surface, split_uv

pyvista = pytest.importorskip("pyvista")


def given():
    mesh = pyvista.PolyData.from_regular_faces(VERTICES, FACES)
    mesh.point_data["x"] = VERTICES[:, 0]
    mesh.point_data["velocity"] = VERTICES
    mesh.cell_data["part"] = np.arange(len(FACES))
    mesh.field_data["made by"] = ["a test"]
    mesh.active_texture_coordinates = UV
    return mesh


def test_the_surface_and_its_data_without_the_old_normals():
    refined = subdivide(given().compute_normals(), 2, SCHEME)
    same_surface(refined.points, refined.regular_faces)
    data = split_uv(VERTICES)
    np.testing.assert_allclose(refined["velocity"], data, atol=1e-12)
    np.testing.assert_allclose(refined["x"], data[:, 0], atol=1e-12)
    np.testing.assert_array_equal(refined["part"], np.repeat(np.arange(len(FACES)), 16))
    np.testing.assert_allclose(refined.active_texture_coordinates, split_uv(UV), atol=1e-6)
    assert list(refined.field_data["made by"]) == ["a test"]
    assert not any("Normals" in data for data in (refined.point_data, refined.cell_data))


def test_every_polydata_has_the_accessor():
    import pns_common.pyvista  # noqa: F401  (it registers `mesh.pns`)

    refined = given().pns.subdivide(2, SCHEME)
    same_surface(refined.points, refined.regular_faces)
    smooth, expected = given().pns.loop(), refine(Mesh(VERTICES, FACES), loop()).mesh
    np.testing.assert_allclose(smooth.points, expected.vertices, atol=1e-12)


@pytest.mark.parametrize(
    ("place", "vectors", "scalars"), [("point", "velocity", "x"), ("cell", "force", "heat")]
)
def test_what_is_active_stays_active(place, vectors, scalars):
    mesh = given()
    mesh.cell_data["force"] = np.ones((len(FACES), 3))
    mesh.cell_data["heat"] = np.arange(len(FACES)) / 2.0
    mesh.set_active_vectors(vectors, preference=place)
    mesh.set_active_scalars(scalars, preference=place)
    refined = subdivide(mesh, 1, SCHEME)
    assert refined.active_vectors_info[:] == mesh.active_vectors_info[:]
    assert refined.active_scalars_info[:] == mesh.active_scalars_info[:]
    assert getattr(refined, f"{place}_data").active_scalars_name == scalars


def test_a_plane_of_quadrangles_becomes_quads_or_triangles_with_its_data():
    plane = pyvista.Plane(i_resolution=3, j_resolution=2)
    plane.point_data["x"] = plane.points[:, 0]
    plane.cell_data["cell"] = np.arange(6)
    refined = subdivide(plane, 2)
    assert refined.regular_faces.shape == (6 * 16, 4)
    assert refined.cell_data["cell"].tolist() == np.repeat(np.arange(6), 16).tolist()
    inside = np.abs(refined.points[:, :2]).max(axis=1) < 0.1
    np.testing.assert_allclose(refined["x"][inside], refined.points[inside, 0], atol=0.05)
    cut = subdivide(plane, 1, SCHEME, triangulate=True)
    assert cut.cell_data["cell"].tolist() == np.repeat(np.arange(6), 8).tolist()


def test_faces_of_many_sizes_become_quads():
    points, faces = cylinder(6)
    padded = np.concatenate([[len(face), *face] for face in faces])
    refined = subdivide(pyvista.PolyData(points, padded), 1, "catmull-clark")
    expected = refine(Mesh(points, faces), catmull_clark(), 1).mesh
    np.testing.assert_allclose(refined.points, expected.vertices, atol=1e-6)
    np.testing.assert_array_equal(refined.regular_faces, expected.faces)


def test_lines_and_points_beside_triangles_are_refused_with_what_to_do():
    """To triangulate it does not help: lines are still there."""
    mesh = pyvista.PolyData(VERTICES, faces=given().faces, lines=[2, 0, 1], verts=[1, 0])
    for refused in (mesh, mesh.triangulate()):
        with pytest.raises(MeshError, match=r"lines \(1\)") as told:
            subdivide(refused)
    advice = str(told.value).split("give ")[1]
    followed = eval(advice, {"pyvista": pyvista, "mesh": mesh})
    assert subdivide(followed, 1, loop()).n_cells == 4 * len(FACES)


def test_a_collection_keeps_names_and_parts_without_faces_which_alone_are_refused():
    line, clouds = pyvista.Line(), (pyvista.PolyData(), pyvista.PolyData(VERTICES))
    inner = pyvista.MultiBlock({"blob": given(), "none": None, "line": line, "cloud": clouds[1]})
    blocks = pyvista.MultiBlock({"inner": inner, "grid": pyvista.ImageData()})
    refined = subdivide(blocks, 2, SCHEME)
    assert refined.keys() == ["inner", "grid"]
    blob, none, *others = refined["inner"]
    same_surface(blob.points, blob.regular_faces)
    assert none is None
    assert [part.n_points for part in others] == [2, len(VERTICES)]
    assert blocks["inner"]["blob"].n_cells == len(FACES)
    for refused in (line, *clouds):
        with pytest.raises(MeshError, match="no faces"):
            subdivide(refused)
