"""Creases, smooth UVs and the weld tolerance for formats without a scene."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, catmull_clark, loop
from service.meshfiles.mesh_file import NORMAL, UV, Layer, of_triangles
from service.meshfiles.refine_mesh_file import refine_mesh_file
from service.options import Limits, Options
from tests.support.gltf.shapes import box, octahedron

ASKING = replace(loop(), creases=Creases(angle=40.0, levels=2))


def refined(shape, texture=None, scheme=None, **options):
    vertices = shape["POSITION"].astype(np.float64)
    triangles = of_triangles(vertices, shape["indices"], texture)
    return refine_mesh_file(triangles, scheme or loop(), Options(**options), Limits())


def at_corners(mesh, name):
    return mesh.layers[name].values[mesh.layers[name].rows]


def positions(mesh):
    return mesh.vertices[mesh.corners]


@pytest.mark.parametrize("scheme", [loop(), catmull_clark()])
def test_flat_shading_goes_where_no_edge_is_to_stay_sharp(scheme):
    shape = box()
    triangles = of_triangles(shape["POSITION"], shape["indices"])
    flat = {NORMAL: Layer(shape["NORMAL"], triangles.corners)}
    triangles = replace(triangles, layers=flat)
    for crease, smooth in (("off", True), ("auto", False)):
        made, _ = refine_mesh_file(triangles, scheme, Options(crease=crease), Limits())
        points, normals = positions(made).round(6), at_corners(made, NORMAL).round(6)
        both = np.unique(np.hstack([points, normals]), axis=0)
        assert (len(both) == len(np.unique(points, axis=0))) == smooth


def test_smooth_uvs_follow_the_positions_of_a_closed_chart():
    shape = octahedron()
    triangles, _ = refined(shape, shape["POSITION"][:, :2], levels=2, uv="smooth")
    np.testing.assert_allclose(at_corners(triangles, UV), positions(triangles)[:, :2], atol=1e-12)


@pytest.mark.parametrize("crease", ["auto", "angle:60"])
def test_smooth_uvs_have_the_creases_of_the_positions(crease):
    shape = box()
    triangles, _ = refined(
        shape, shape["POSITION"][:, 1:], levels=3, uv="smooth", crease=crease, scheme=ASKING
    )
    np.testing.assert_allclose(at_corners(triangles, UV), positions(triangles)[:, 1:], atol=1e-12)


def slit(opened):
    """Two squares of an OBJ along a slit whose two sides have vertices of their own."""
    rows = [(x, y, 0.0) for y in (0, 1) for x in (0, 1)] + [
        (x, y, 0.0) for y in (1, 2) for x in (0, 1)
    ]
    points = np.array(rows)
    points[4:, 1] += opened
    return of_triangles(points, np.array([[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]]))


def test_by_index_poses_have_one_numbering_and_by_position_they_need_not():
    counts = {}
    for weld in ("position", "index", "off"):
        made = [
            refine_mesh_file(
                slit(gap), loop(), Options(levels=1, weld=weld), Limits(), traced=True
            )[0]
            for gap in (0.0, 0.5)
        ]
        counts[weld] = [len(mesh.vertices) for mesh in made]
        if weld != "position":
            np.testing.assert_array_equal(made[0].corners, made[1].corners)
            for mesh, gap in zip(made, (0.0, 0.5), strict=True):
                parents, again = mesh.parents, np.zeros_like(mesh.vertices)
                values = parents.weights[:, None] * slit(gap).vertices[parents.columns]
                np.add.at(again, parents.rows, values)
                np.testing.assert_allclose(again, mesh.vertices, atol=1e-14)
    assert counts == {"position": [15, 18], "index": [18, 18], "off": [18, 18]}
