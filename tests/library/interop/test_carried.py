"""Data follow a refined surface linearly, and seams of the data are none of the surface."""

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, loop, refine
from pns_common.interop.carried import CarriedMesh, join_by_position, refine_carried
from tests.support.meshes import bumpy_sphere, grid


def seamed(vertices, faces):
    """Every face with three vertices of its own, as a file with a seam at each edge has them."""
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def test_seams_do_not_tear_the_surface():
    vertices, faces = bumpy_sphere()
    whole = refine(Mesh(vertices, faces), loop(), 2).mesh
    torn, refinement = refine_carried(CarriedMesh(*seamed(vertices, faces)), loop(), 2, {})
    corners = np.sort(torn.vertices[torn.faces].reshape(-1, 3), axis=0)
    expected = np.sort(whole.vertices[whole.faces].reshape(-1, 3), axis=0)
    np.testing.assert_allclose(corners, expected, atol=1e-14)
    assert len(torn.vertices) > len(refinement.mesh.vertices) == len(whole.vertices)


def test_linear_data_stay_linear_functions_of_the_midpoint_mesh():
    """Data equal to the control positions come out as positions of the midpoint split."""
    vertices, faces = seamed(*bumpy_sphere())
    data = {"at": vertices, "x": vertices[:, 0]}
    mesh = CarriedMesh(vertices, faces, data, {"at": vertices[faces]}, {"face": faces[:, 0]})
    refined, _ = refine_carried(mesh, loop(), 3, {})
    np.testing.assert_allclose(refined.points["at"][: len(vertices)], vertices)
    np.testing.assert_allclose(refined.points["x"], refined.points["at"][:, 0])
    # Corner data go another way and meet the points' at every corner.
    np.testing.assert_allclose(refined.corners["at"], refined.points["at"][refined.faces])
    # A child lies in the plane of its parent, and is named after it.
    parents = mesh.vertices[refined.cells["face"]]
    normals = np.cross(*(vertices[faces][:, i] - vertices[faces][:, 0] for i in (1, 2)))
    along = np.repeat(normals, 64, axis=0)
    away = refined.corners["at"] - parents[:, None]
    assert np.abs(np.einsum("fci,fi->fc", away, along)).max() < 1e-12


def test_creases_name_vertices_of_the_mesh_that_was_given():
    vertices, faces = bumpy_sphere()
    crease = np.array([faces[0, :2]])
    expected = refine(Mesh(vertices, faces), loop(), 1, creases=crease).report
    mesh = CarriedMesh(*seamed(vertices, faces))
    _, refinement = refine_carried(mesh, loop(), 1, {"creases": np.array([[0, 1]])})
    assert refinement.report["levels"] == expected["levels"]


def test_vertices_are_joined_by_first_appearance_and_minus_zero_is_zero():
    joined, first = join_by_position(np.array([[1.0, 0, 0], [0, 0, 0], [1, 0, 0], [0, -0.0, 0]]))
    assert joined.tolist() == [0, 1, 0, 1]
    assert first.tolist() == [0, 1]


@pytest.mark.parametrize("pairs", [[[0, 99]], [[-1, 0]]])
def test_creases_of_other_vertices_are_refused(pairs):
    vertices, faces = grid(3)
    for creases in (np.array(pairs), Creases(np.array(pairs), levels=2)):
        with pytest.raises(ParameterError, match="creases"):
            refine_carried(CarriedMesh(vertices, faces), loop(), 1, {"creases": creases})


def test_by_index_vertices_in_one_place_stay_apart_and_all_keep_their_numbers():
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [9, 9, 9.0]]
    )
    mesh = CarriedMesh(vertices, np.array([[0, 1, 2], [3, 5, 4]]))
    for weld, boundary in (("position", 4), ("index", 6)):
        made, refinement = refine_carried(mesh, loop(), 1, {"weld": weld})
        assert refinement.report["levels"][0]["edges"]["boundary"] == boundary
        assert len(made.vertices) == 13
        assert made.vertices[6].tolist() == [9, 9, 9]  # of no face
    with pytest.raises(ParameterError, match="weld"):
        refine_carried(mesh, loop(), 1, {"weld": "off"})
