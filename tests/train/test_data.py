"""Data: batches, sets, primitives, parts and dense meshes."""

from itertools import islice

import numpy as np
import pytest
import torch

from tests.support.shared import published
from train.connectivity import connect
from train.data.batch import disjoint_union
from train.data.datasets import DATASETS, ridge_training
from train.data.dense_meshes import is_manifold
from train.data.plane_meshes import regular_grid, scattered, turned_grid
from train.data.primitives import PRIMITIVES, TRIANGULATED_QUADS, icosphere
from train.data.simplifiers import SIMPLIFIERS, simplified
from train.data.stream import (
    FAMILIES,
    crossing,
    held_out_families,
    stream,
    trained_families,
)
from train.metrics.shape import volume


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


ALL = {**PRIMITIVES, **TRIANGULATED_QUADS}


@pytest.mark.parametrize("name", ALL)
def test_is_closed_manifold_and_faces_outwards(name):
    mesh = ALL[name]()
    assert connect(mesh.faces, len(mesh.vertices)).paired.all()
    assert is_manifold(mesh)
    assert volume(mesh) > 0


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


@pytest.mark.parametrize("maker", [regular_grid, turned_grid, scattered])
def test_plane_meshes_cover_the_square_with_faces_that_look_up(maker):
    plane = maker(np.random.default_rng(0), 9, 0.4)
    u, v = (plane.points[plane.faces[:, k]] - plane.points[plane.faces[:, 0]] for k in (1, 2))
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    assert area.min() > 0
    assert 3.9 < area.sum() <= 4 + 1e-9
