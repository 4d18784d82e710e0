"""Faces of meshes that pass through other faces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pns_common import Mesh
from train.data.icosphere import icosphere
from train.metrics.self_intersection import crossing_faces


def by_every_pair(mesh):
    """Solve for where each edge meets each face's plane: slow, and written otherwise."""
    crossing = np.zeros(len(mesh.faces), dtype=bool)
    for i, face in enumerate(mesh.faces):
        for j, other in enumerate(mesh.faces):
            if i == j or len(set(face) & set(other)) > 1:
                continue
            a, b, c = mesh.vertices[other]
            for corner in range(3):
                start, end = mesh.vertices[face[corner]], mesh.vertices[face[(corner + 1) % 3]]
                matrix = np.stack([b - a, c - a, start - end], axis=1)
                if abs(np.linalg.det(matrix)) < 1e-14:
                    continue
                u, v, t = np.linalg.solve(matrix, start - a)
                if min(u, v, t) > 1e-9 and u + v < 1 - 1e-9 and t < 1 - 1e-9:
                    crossing[i] = crossing[j] = True
    return crossing


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 10**6), noise=st.sampled_from([0.05, 0.15, 0.4]))
def test_agrees_with_every_pair(seed, noise):
    rng = np.random.default_rng(seed)
    sphere = icosphere(1)
    mesh = Mesh(sphere.vertices + noise * rng.normal(size=sphere.vertices.shape), sphere.faces)
    np.testing.assert_array_equal(crossing_faces(mesh), by_every_pair(mesh))


@pytest.mark.parametrize("seed", range(5))
def test_a_wall_of_rulings_does_not_cross_itself_by_rounding(seed):
    """Along a ruling all faces lie in one plane but for rounding."""
    bend = np.cumsum(np.random.default_rng(seed).uniform(-0.2, 0.2, 9))
    line = np.cumsum(np.stack([np.cos(bend), np.sin(bend)], axis=1), axis=0)
    heights = np.cumsum(np.random.default_rng(seed + 9).uniform(0.1, 1.0, 9)) / 3
    points = np.array([[x, y, z] for x, y in line for z in heights])
    corner = np.array([9 * i + j for i in range(8) for j in range(8)])
    faces = np.concatenate(
        [
            np.stack([corner, corner + 9, corner + 10], 1),
            np.stack([corner, corner + 10, corner + 1], 1),
        ]
    )
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    noise = 1e-11 * np.random.default_rng(seed).normal(size=points.shape)
    assert not crossing_faces(Mesh(points @ turn + noise, faces)).any()
