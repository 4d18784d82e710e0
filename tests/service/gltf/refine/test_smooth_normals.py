"""normals=smooth: what a file without normals, or with hard ones, comes back with."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf.files import glb
from tests.support.gltf.files import primitive_of as indices_and_attributes
from tests.support.gltf.shapes import box, octahedron


def refined(*meshes, **options):
    chosen = Options(**({"scheme": "loop", "levels": 2, "normals": "smooth"} | options))
    return subdivide_gltf(glb(*meshes), "glb", chosen, None, Limits()).glb


def primitive_of(data, primitive=0):
    indices, attributes = indices_and_attributes(data, primitive=primitive)
    return attributes | {"indices": indices}


def plain(shape):
    return {name: values for name, values in shape.items() if name in ("POSITION", "indices")}


def test_a_file_without_normals_gets_the_vertex_normals_of_its_refined_surface():
    result = primitive_of(refined([plain(octahedron())], limit=False))
    surface = trimesh.Trimesh(result["POSITION"], result["indices"].reshape(-1, 3), process=False)
    assert surface.is_watertight
    np.testing.assert_allclose(result["NORMAL"], surface.vertex_normals, atol=1e-5)


def test_copies_of_faces_make_no_new_normal_somebody_s_own():
    """They count in the surface's normals, and not in those that the control mesh is given."""
    shape = plain(octahedron())
    faces = np.asarray(shape["indices"]).reshape(-1, 3)
    # They may begin at another corner.
    copies = [np.roll(faces[:1], first, axis=1) for first in range(3)]
    result = primitive_of(
        refined([shape | {"indices": np.concatenate([faces, *copies])}], limit=False)
    )
    placed = np.hstack([result["POSITION"], result["NORMAL"]])
    assert len(np.unique(placed, axis=0)) == 66  # each point has one, whoever's it is
    surface = trimesh.Trimesh(result["POSITION"], result["indices"].reshape(-1, 3), process=False)
    np.testing.assert_allclose(result["NORMAL"], surface.vertex_normals, atol=1e-5)


def test_without_the_option_a_file_without_normals_stays_without():
    assert "NORMAL" not in primitive_of(refined([plain(octahedron())], normals="keep"))


def test_a_mesh_without_normals_comes_back_smooth_but_for_sharp_edges():
    by_default = {"normals": "auto", "crease": "angle:30"}
    smooth = primitive_of(refined([plain(octahedron())], normals="auto"))
    assert directions(smooth) == 1
    sharp = primitive_of(refined([plain(box())], **by_default))
    np.testing.assert_allclose(np.abs(sharp["NORMAL"]).max(axis=1), 1, atol=1e-6)
    assert directions(sharp) == 3


def test_normals_that_are_there_stay_beside_meshes_without_any():
    """Each mesh of a file is asked for itself."""
    result = refined([flat_box()], [plain(octahedron())], normals="auto")
    kept = primitive_of(refined([flat_box()], normals="keep"))
    np.testing.assert_array_equal(primitive_of(result)["NORMAL"], kept["NORMAL"])
    assert "NORMAL" in indices_and_attributes(result, mesh=1)[1]


def test_hard_edges_of_the_file_are_softened():
    flat = primitive_of(refined([flat_box()], normals="keep"))
    smooth = primitive_of(refined([flat_box()]))
    assert directions(flat) > 1
    # One normal wherever the surface has one point.
    assert directions(smooth) == 1


def test_creases_by_the_files_own_normals_are_found_before_these_are_replaced():
    by_normals = primitive_of(refined([flat_box()], crease="normals"))
    by_angle = primitive_of(refined([flat_box()], crease="angle:30"))
    for name in ("POSITION", "NORMAL"):
        np.testing.assert_array_equal(by_normals[name], by_angle[name])


def test_a_face_and_its_back_have_opposite_normals():
    shape = plain(octahedron())
    faces = np.asarray(shape["indices"]).reshape(-1, 3)
    both = shape | {"indices": np.concatenate([faces, faces[:, [0, 2, 1]]])}
    result = primitive_of(refined([both]))
    corners = result["POSITION"][result["indices"].reshape(-1, 3)]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = (result["NORMAL"][result["indices"].reshape(-1, 3)] * normal[:, None]).sum(axis=2)
    assert (along > 0).all()


def test_normals_of_the_limit_are_those_that_ever_deeper_levels_approach():
    exact = primitive_of(refined([plain(octahedron())]))
    deep = primitive_of(refined([plain(octahedron())], levels=6))
    # On the limit surface the vertices of level 2 are among those of level 6, in the same places.
    distance, which = cKDTree(deep["POSITION"]).query(exact["POSITION"])
    assert distance.max() < 1e-6
    corners = exact["POSITION"][exact["indices"].reshape(-1, 3)]
    surface = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    _, same = cKDTree(surface.vertices).query(exact["POSITION"])
    apart = [
        np.linalg.norm(normals - deep["NORMAL"][which], axis=1).max()
        for normals in (exact["NORMAL"], surface.vertex_normals[same])
    ]
    assert apart[0] < 1e-6
    assert apart[1] > 2e-3


def test_a_crease_keeps_a_normal_for_each_side_on_the_limit_too():
    creased = primitive_of(refined([flat_box()], crease="angle:30"))
    np.testing.assert_allclose(np.abs(creased["NORMAL"]).max(axis=1), 1, atol=1e-6)


def flat_box():
    """A box of 24 vertices with the normals of its sides."""
    solid = trimesh.creation.box()
    points = solid.triangles.reshape(-1, 3)
    return {
        "POSITION": points,
        "NORMAL": np.repeat(solid.face_normals, 3, axis=0),
        "indices": np.arange(len(points)),
    }


def directions(primitive):
    """Return how many different normals the richest place has."""
    places = np.round(primitive["POSITION"], 6) + 0.0
    _, which = np.unique(places, axis=0, return_inverse=True)
    normals = np.round(primitive["NORMAL"], 4) + 0.0
    pairs = np.unique(np.column_stack([which.reshape(-1), normals]), axis=0)
    return int(np.bincount(pairs[:, 0].astype(int)).max())
