"""The parts lie on the surfaces that they are called after, and are closed and smooth."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from pns_common import Mesh
from train.data.parts import (
    CAD_PARTS,
    cube_faces,
    knob,
    pipe,
    pulley,
    rounded_box,
    rounded_cylinder,
    stepped_shaft,
    torus,
)
from train.surfaces.cad import Torus


@pytest.fixture(scope="module", params=CAD_PARTS)
def part(request):
    mesh = CAD_PARTS[request.param](1)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_parts_are_closed_and_look_outwards(part):
    assert part.is_watertight
    assert part.is_winding_consistent
    assert part.volume > 0
    assert part.body_count == 1


@pytest.mark.parametrize("name", CAD_PARTS)
def test_a_finer_part_has_the_grid_of_the_coarser_in_it(name):
    coarse, fine = CAD_PARTS[name](1), CAD_PARTS[name](2)
    assert len(fine.faces) > 3.9 * len(coarse.faces)
    apart, _ = cKDTree(fine.vertices).query(coarse.vertices)
    assert apart.max() < 1e-12


def test_parts_are_dense_and_smooth(part):
    assert 10_000 < len(part.faces) < 30_000
    assert part.area_faces.min() > 0
    assert np.degrees(part.face_adjacency_angles).max() < 16


def off_box(points, half):
    """Signed distance from a box of any dimension, by its closed form."""
    q = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(q, 0), axis=1)
    return outside + np.minimum(q.max(axis=1), 0)


def radius_and_height(mesh):
    return np.stack([np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]), mesh.vertices[:, 2]], 1)


def test_the_torus_is_one():
    surface = Torus(ring=0.65, tube=0.35)
    np.testing.assert_allclose(surface.value(torus().vertices), 0, atol=1e-15)


def test_the_rounded_box_is_one_with_both_corners_and_flats():
    half = np.array([0.8, 0.5, 0.2])
    vertices = rounded_box().vertices
    np.testing.assert_allclose(off_box(vertices, half), 0.2, atol=1e-15)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), [2, 1.4, 0.8], atol=1e-15)


def test_the_rounded_cylinder_is_a_box_turned_round_its_axis():
    distance = off_box(radius_and_height(rounded_cylinder()), np.array([0.5, 0.5]))
    np.testing.assert_allclose(distance, 0.2, atol=1e-15)


def test_the_knob_is_that_cylinder_waved_and_flattened():
    mesh = knob()
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    profile = radius_and_height(mesh)
    profile[:, 0] /= 1 + 0.1 * np.cos(8 * angle)
    profile[:, 1] /= 0.8
    np.testing.assert_allclose(off_box(profile, np.array([0.5, 0.5])), 0.2, atol=1e-14)


def test_the_pipe_is_everywhere_its_radius_from_the_trefoil():
    t = np.linspace(0, 2 * np.pi, 200_000, endpoint=False)
    curve = [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)]
    distance, _ = cKDTree(np.stack(curve, axis=1) / 3).query(pipe().vertices)
    np.testing.assert_allclose(distance, 0.13, atol=1e-8)


def pappus(areas_and_centroids):
    """Volume of a solid of revolution: each piece of its profile times its centroid's way."""
    return sum(area * 2 * np.pi * centroid for area, centroid in areas_and_centroids)


QUARTER = np.pi / 4
# A quarter disc's centroid from its tangents' corner, in radii.
FROM_CORNER = 1 - 4 / (3 * np.pi)


def spandrel(radius, corner, *, inwards):
    """What rounding takes off a corner (or a fillet fills in): a square less a quarter disc."""
    sign = -1 if inwards else 1
    square, disc = radius**2, QUARTER * radius**2
    area = square - disc
    moment = square * (corner + sign * radius / 2) - disc * (corner + sign * FROM_CORNER * radius)
    return area, moment / area


def test_the_stepped_shaft_has_the_volume_of_its_profile():
    pieces = [(0.7 * 0.7, 0.35), (0.35 * 1.0, 0.175)]
    for radius, corner in ((0.12, 0.7), (0.12, 0.7), (0.1, 0.35)):
        area, centroid = spandrel(radius, corner, inwards=True)
        pieces.append((-area, centroid))
    pieces.append(spandrel(0.15, 0.35, inwards=False))
    mesh = stepped_shaft()
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume
    assert volume == pytest.approx(pappus(pieces), rel=3e-3)


def test_the_pulleys_groove_touches_its_edges():
    profile = radius_and_height(pulley())
    reach = np.sqrt(0.35**2 - 0.32**2)
    from_groove = np.hypot(profile[:, 0] - 0.8 - reach, profile[:, 1])
    from_edge = np.hypot(profile[:, 0] - 0.8, np.abs(profile[:, 1]) - 0.32)
    on_flat = np.isclose(np.abs(profile[:, 1]), 0.42, atol=1e-12) & (profile[:, 0] <= 0.8 + 1e-12)
    on_circle = np.isclose(from_groove, 0.25, atol=1e-12) | np.isclose(from_edge, 0.1, atol=1e-12)
    assert (on_flat | on_circle).all()
    assert profile[on_circle, 0].min() == pytest.approx(0.8 + reach - 0.25, abs=1e-12)


def test_the_cubes_lattice_is_its_surface():
    lattice, faces = cube_faces(3)
    assert len(lattice) == 4**3 - 2**3
    assert ((lattice == 0) | (lattice == 3)).any(axis=1).all()
    cube = trimesh.Trimesh(Mesh(lattice, faces).vertices, faces, process=False)
    assert cube.is_watertight
    assert cube.volume == pytest.approx(27)
