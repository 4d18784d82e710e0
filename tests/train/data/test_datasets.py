import numpy as np
import pytest
from pns_common.connectivity.topology import build_topology

from tests.support.shared import published
from train.data.datasets import DATASETS
from train.data.grid import SIDE, grid_faces, jittered_grid

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
    topology = build_topology(faces, SIDE**2)
    assert len(faces) == 128
    assert SIDE**2 - len(topology.edges) + len(faces) == 1
    a, b, c = jittered_grid(0, jitter=0.0).numpy()[faces].swapaxes(0, 1)
    u, v = b - a, c - a
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0).all()
