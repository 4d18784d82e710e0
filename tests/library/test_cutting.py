"""Concave polygons become convex pieces of the same corners and area, which quads then tile."""

import sys

import numpy as np
import pytest

from pns_common import Mesh, catmull_clark, cut_concave, refine
from pns_common.mesh.cutting import are_star_shaped, convex_pieces
from tests.support.meshes import rotation
from tests.support.polygons import SHAPES

# Of area 30: two legs and what joins them.
LETTER_U = [(0, 0), (7, 0), (7, 6), (5, 6), (5, 2), (2, 2), (2, 6), (0, 6)]
LETTER_L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
# A side of the spiral runs beside itself, with a corner on a straight side.
SPIRAL = [(0, 0), (4, 0), (8, 0), (8, 8), (2, 8), (2, 4), (4, 4), (4, 6), (6, 6), (6, 2), (0, 2)]
DART = [(0, 0), (2, -1), (0.5, 0), (2, 1)]
CONCAVE = {"U": LETTER_U, "L": LETTER_L, "spiral": SPIRAL, "dart": DART}


def in_plane(outline):
    return np.column_stack([np.array(outline, dtype=float), np.zeros(len(outline))])


def polygon(outline):
    return Mesh(in_plane(outline), [list(range(len(outline)))])


def area_vectors(mesh):
    return np.array(
        [
            sum(np.cross(p, q) for p, q in zip(own, np.roll(own, -1, axis=0), strict=True)) / 2
            for own in (mesh.vertices[face] for face in mesh.polygons)
        ]
    )


def turns(mesh):
    """The z of each corner's turn, of faces in the plane."""
    for face in mesh.polygons:
        own = mesh.vertices[face]
        before, after = own - np.roll(own, 1, axis=0), np.roll(own, -1, axis=0) - own
        yield from np.cross(before, after)[:, 2]


@pytest.mark.parametrize("shift", range(4))
@pytest.mark.parametrize("name", CONCAVE)
def test_pieces_are_convex_and_keep_area_and_corners(name, shift):
    mesh = polygon(CONCAVE[name])
    mesh = Mesh(mesh.vertices, [np.roll(mesh.corners, shift).tolist()])
    made = cut_concave(mesh)
    assert made.face_count > 1
    assert min(turns(made)) >= 0
    areas = area_vectors(made)
    assert (areas[:, 2] > 0).all()
    np.testing.assert_allclose(areas.sum(axis=0), area_vectors(mesh)[0], rtol=0, atol=1e-12)
    assert set(made.corners) == set(mesh.corners)
    assert are_star_shaped(made.vertices, made.offsets, made.corners).all()


def test_catmull_clark_tiles_a_letter_once_it_is_cut():
    """No quad lies over another: their areas sum up to what the outline encloses."""

    def covered(mesh):
        fixed = refine(mesh, catmull_clark(), 2, border="fixed").mesh
        assert np.abs(area_vectors(fixed).sum(axis=0)[2]) == pytest.approx(30)
        return np.abs(area_vectors(fixed)[:, 2]).sum()

    assert covered(polygon(LETTER_U)) > 31
    assert covered(cut_concave(polygon(LETTER_U))) == pytest.approx(30, rel=1e-12)


def test_a_concave_polygon_is_cut_in_any_plane():
    rng = np.random.default_rng(3)
    for _ in range(50):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 20))
        if np.diff(angle, append=angle[0] + 2 * np.pi).max() > 3:
            continue
        flat = (0.05 + rng.random((20, 1))) * np.column_stack([np.cos(angle), np.sin(angle)])
        mesh = Mesh(in_plane(flat) @ rotation(rng).T + rng.standard_normal(3), [[*range(20)]])
        made = cut_concave(mesh)
        whole, areas = area_vectors(mesh)[0], area_vectors(made)
        assert (areas @ whole > 0).all()
        np.testing.assert_allclose(areas.sum(axis=0), whole, rtol=0, atol=1e-12)
        assert are_star_shaped(made.vertices, made.offsets, made.corners).all()


@pytest.mark.parametrize("name", SHAPES)
def test_polygons_that_are_star_shaped_stay(name):
    mesh = Mesh(*SHAPES[name])
    assert cut_concave(mesh) is mesh


def test_a_polygon_that_crosses_itself_stays_and_is_counted():
    mesh = polygon([(0, 0), (3, 3), (3, 0), (0, 2)])
    assert cut_concave(mesh) is mesh
    assert convex_pieces(mesh.vertices, mesh.offsets, mesh.corners).crossed == 1


@pytest.mark.parametrize("size", [1e-60, 1e74])
def test_the_size_of_a_polygon_does_not_matter(size):
    letter = polygon(LETTER_U)
    made = cut_concave(Mesh(size * letter.vertices, letter.faces))
    np.testing.assert_array_equal(made.corners, cut_concave(letter).corners)


def test_what_cutting_needs_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    with pytest.raises(ImportError, match=r"pip install 'pns-subdivision\[polygons\]'"):
        cut_concave(polygon(LETTER_U))
    assert cut_concave(Mesh(*SHAPES["cube"])).face_count == 6
