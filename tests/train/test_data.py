"""Data: batches, sets, primitives, parts and dense meshes."""

from itertools import islice

import numpy as np
import pytest
import torch

from pns_common import Mesh
from tests.support.shared import published
from train.connectivity import connect
from train.data.batch import disjoint_union
from train.data.datasets import DATASETS, SIDE, grid_faces, jittered_grid, ridge_training
from train.data.dense_meshes import is_manifold
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
    assert len(sizes) > 5


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
