"""Data: batches, sets, primitives, parts and dense meshes."""

from itertools import islice

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from pns_common import Mesh
from tests.support.shared import published
from train.connectivity import connect
from train.data.batch import disjoint_union
from train.data.datasets import DATASETS, SIDE, grid_faces, jittered_grid, ridge_training
from train.data.dense_meshes import is_manifold
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
from train.data.plane_meshes import regular_grid, scattered, turned_grid
from train.data.primitives import PRIMITIVES, TRIANGULATED_QUADS, cylinder, icosphere, l_block
from train.data.simplifiers import SIMPLIFIERS, fast_quadric, simplified
from train.data.stream import (
    FAMILIES,
    SHARES,
    crossing,
    decimated,
    held_out_families,
    stream,
    trained_families,
)
from train.metrics.shape import volume
from train.surfaces.cad import Torus
from train.surfaces.implicit import signed_distance


def test_each_inserted_vertex_belongs_to_its_own_instance():
    instances = ridge_training().instances[:3]
    batch = disjoint_union(instances)
    level = batch.mesh
    midpoints = batch.points.numpy()[level.edges[level.interior]].mean(axis=1)
    values = batch.surface.value(torch.from_numpy(midpoints)).numpy()
    per_mesh = len(level.interior) // 3
    for index, instance in enumerate(instances):
        rows = slice(index * per_mesh, (index + 1) * per_mesh)
        expected = instance.surface.value(midpoints[rows])
        np.testing.assert_allclose(values[rows], expected, rtol=0, atol=1e-15)


def test_union_keeps_every_mesh_and_joins_none():
    instances = ridge_training().instances[:3]
    batch = disjoint_union(instances)
    count = len(instances[0].mesh.vertices)
    assert batch.points.dtype == torch.float64
    assert len(batch.children) == 4 * sum(len(instance.mesh.faces) for instance in instances)
    for index, instance in enumerate(instances):
        rows = slice(index * count, (index + 1) * count)
        np.testing.assert_array_equal(batch.points[rows], instance.mesh.vertices)
    owners = batch.mesh.stencil[batch.mesh.interior] // count
    assert (owners == owners[:, :1]).all()


PUBLISHED_NAMES = {
    "ridge-training": "ridge_train",
    "ridge-held-out": "ridge_test",
    "saddle-training": "saddle_train",
    "saddle-held-out": "saddle_test",
    "sphere-ridge-held-out": "sphere_test",
}
FLOAT32_ROUNDING = 1.2e-7


@pytest.mark.parametrize("name", DATASETS)
def test_instances_are_the_published_ones_to_float32(name):
    data, key = published("datasets.npz"), PUBLISHED_NAMES[name]
    instances = DATASETS[name]().instances
    vertices = np.stack([instance.mesh.vertices for instance in instances])
    np.testing.assert_allclose(vertices, data[f"{key}_vertices"], rtol=0, atol=FLOAT32_ROUNDING)
    for instance in instances:
        np.testing.assert_array_equal(instance.mesh.faces, data[f"{key}_faces"])


@pytest.mark.parametrize("name", DATASETS)
def test_coarse_vertices_lie_on_their_surface(name):
    for instance in DATASETS[name]().instances:
        np.testing.assert_allclose(instance.surface.value(instance.mesh.vertices), 0, atol=5e-7)


@pytest.mark.parametrize("name", DATASETS)
def test_drawing_again_gives_the_same_instances(name):
    first, again = DATASETS[name](), DATASETS[name]()
    assert first.name == name
    for drawn, redrawn in zip(first.instances, again.instances, strict=True):
        np.testing.assert_array_equal(drawn.mesh.vertices, redrawn.mesh.vertices)
        assert drawn.surface == redrawn.surface


def test_only_interior_vertices_are_jittered():
    plain, jittered = jittered_grid(3, jitter=0.0), jittered_grid(3, jitter=0.04)
    moved = (plain != jittered).any(dim=-1).reshape(SIDE, SIDE)
    assert moved[1:-1, 1:-1].all()
    assert moved.sum() == (SIDE - 2) ** 2
    assert (plain - jittered).abs().max() <= 0.04 / SIDE + 1e-7


def test_patch_is_a_disc_with_all_normals_up():
    faces = grid_faces()
    edges = connect(faces, SIDE**2).edges
    assert len(faces) == 128
    assert SIDE**2 - len(edges) + len(faces) == 1
    a, b, c = jittered_grid(0, jitter=0.0).numpy()[faces].swapaxes(0, 1)
    u, v = b - a, c - a
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0).all()


ALL = {**PRIMITIVES, **TRIANGULATED_QUADS}


@pytest.mark.parametrize("name", ALL)
def test_is_closed_manifold_and_faces_outwards(name):
    mesh = ALL[name]()
    assert connect(mesh.faces, len(mesh.vertices)).paired.all()
    assert is_manifold(mesh)
    assert volume(mesh) > 0


def test_volumes_and_counts():
    assert volume(l_block()) == pytest.approx(3)
    assert volume(cylinder(200, 3, 2.0)) == pytest.approx(2 * np.pi, rel=1e-3)
    for splits, faces in enumerate((20, 80, 320)):
        sphere = icosphere(splits)
        assert len(sphere.faces) == faces
        np.testing.assert_allclose(np.linalg.norm(sphere.vertices, axis=1), 1)
    globe = PRIMITIVES["globe 20"]()
    valence = connect(globe.faces, len(globe.vertices)).valence
    assert sorted(valence.tolist())[-2:] == [20, 20]


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


SPHERE = icosphere(4)


@pytest.mark.parametrize("name", SIMPLIFIERS)
@pytest.mark.parametrize("faces", [100, 500])
def test_comes_near_the_target_and_stays_on_the_sphere(name, faces):
    coarse = simplified(SPHERE, SIMPLIFIERS[name], faces)
    assert coarse is not None
    assert faces / 1.6 <= len(coarse.faces) <= 1.6 * faces
    radius = np.linalg.norm(coarse.vertices, axis=1)
    assert np.abs(radius - 1).max() < 0.15


@pytest.mark.parametrize("name", SIMPLIFIERS)
def test_is_deterministic(name):
    coarse, again = (SIMPLIFIERS[name](SPHERE, 200) for _ in range(2))
    np.testing.assert_array_equal(coarse.vertices, again.vertices)
    np.testing.assert_array_equal(coarse.faces, again.faces)


def test_is_left_out_where_the_target_is_missed_or_little_hangs_together():
    assert simplified(SPHERE, lambda mesh, _: mesh, 100) is None
    many = [np.add(SPHERE.vertices, [3.0 * k, 0, 0]) for k in range(3)]
    count = len(SPHERE.vertices)
    parts = Mesh(np.concatenate(many), np.concatenate([SPHERE.faces + count * k for k in range(3)]))
    assert simplified(parts, fast_quadric, 600) is None


COUNT = 60


@pytest.fixture(scope="module")
def instances():
    return list(islice(stream(0), COUNT))


def test_the_same_seed_draws_the_same(instances):
    for drawn, redrawn in zip(instances, stream(0), strict=False):
        assert drawn.surface == redrawn.surface
        np.testing.assert_array_equal(drawn.mesh.vertices, redrawn.mesh.vertices)
        np.testing.assert_array_equal(drawn.mesh.faces, redrawn.mesh.faces)
    assert next(stream(1)).surface != instances[0].surface


def test_coarse_vertices_lie_on_their_surface_but_for_simplified_meshes(instances):
    off = [np.abs(signed_distance(i.surface, i.mesh.vertices)).max() for i in instances]
    assert sum(distance < 1e-9 for distance in off) > COUNT / 2
    assert max(off) < 0.05


def test_every_mesh_is_a_manifold_patch_of_some_hundred_faces(instances):
    for instance in instances:
        level = connect(instance.mesh.faces, len(instance.mesh.vertices))
        assert (level.paired | level.boundary).all()
        assert 60 < len(instance.mesh.faces) < 320


def test_there_are_extraordinary_vertices_and_several_resolutions(instances):
    valences, sizes = set(), set()
    for instance in instances:
        level = connect(instance.mesh.faces, len(instance.mesh.vertices))
        valences |= set(level.valence.tolist())
        sizes.add(len(instance.mesh.faces))
    assert {3, 4, 5, 6, 7, 8} <= valences
    assert len(sizes) > 10


def test_families_held_out_are_in_no_stream(instances):
    seen = {type(instance.surface) for instance in islice(stream(3), 200)}
    held_out = {
        type(instance.surface) for family in held_out_families() for instance in family.instances
    }
    trained = {
        type(instance.surface) for family in trained_families() for instance in family.instances
    }
    assert not seen & held_out
    assert trained <= seen
    assert crossing not in FAMILIES.values()


def test_every_family_has_its_share():
    assert len(SHARES) == len(FAMILIES)
    assert sum(SHARES) == pytest.approx(1)


@pytest.mark.parametrize("maker", [regular_grid, turned_grid, scattered])
def test_plane_meshes_cover_the_square_with_faces_that_look_up(maker):
    plane = maker(np.random.default_rng(0), 9, 0.4)
    u, v = (plane.points[plane.faces[:, k]] - plane.points[plane.faces[:, 0]] for k in (1, 2))
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    assert area.min() > 0
    assert 3.9 < area.sum() <= 4 + 1e-9


def test_a_simplified_mesh_stays_near_its_surface_with_fewer_vertices():
    drawn = FAMILIES["bump"](np.random.default_rng(1))
    mesh = decimated(np.random.default_rng(2), drawn.lift)
    assert len(mesh.vertices) < 200
    assert np.abs(signed_distance(drawn.surface, mesh.vertices)).max() < 0.05
