"""Dense meshes made coarse at random: near the count, in every way, and the same for a seed."""

from collections import Counter

import numpy as np

from pns_common.mesh import Mesh
from train.data.pairs import coarsened as subject
from train.data.pairs.coarsened import WAYS, coarsened
from train.data.primitives import icosphere
from train.data.simplifiers import SIMPLIFIERS

SPHERE = icosphere(3)


def made(seed: int, count: int = 200) -> Mesh | None:
    return coarsened(SPHERE.vertices, SPHERE.faces, count, np.random.default_rng(seed))


def test_a_coarse_sphere_lies_near_the_sphere_with_mostly_the_faces_asked_for():
    """Careful sweeps may stop before they are there."""
    meshes = [mesh for mesh in map(made, range(8)) if mesh is not None]
    assert 150 <= np.median([len(mesh.faces) for mesh in meshes]) <= 280
    for mesh in meshes:
        assert len(mesh.faces) < len(SPHERE.faces)
        assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 0.12


def test_a_seed_draws_the_same_mesh_again_and_another_seed_another():
    first, again, other = made(1), made(1), made(2)
    assert first is not None
    assert again is not None
    np.testing.assert_array_equal(first.vertices, again.vertices)
    assert other is None or first.vertices.tobytes() != other.vertices.tobytes()


def test_every_way_of_the_table_is_taken_about_as_often_as_it_says(monkeypatch):
    seen: Counter[str] = Counter()
    noted = {
        name: (lambda mesh, count, name=name: (seen.update([name]), mesh)[1])
        for name in SIMPLIFIERS
    }
    monkeypatch.setattr(subject, "SIMPLIFIERS", noted)
    monkeypatch.setattr(
        subject, "fast_quadric", lambda *_: (seen.update(["fast-quadric"]), SPHERE)[1]
    )
    rng = np.random.default_rng(0)
    for _ in range(400):
        coarsened(SPHERE.vertices, SPHERE.faces, 100, rng)
    for way, share in WAYS.items():
        assert abs(seen[way] / 400 - share) < 0.08


def test_what_is_no_manifold_any_more_is_left_out(monkeypatch):
    """Two triangles on one edge of a third."""
    fan = Mesh(np.eye(5)[:, :3], np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]] * 3))
    monkeypatch.setattr(subject, "SIMPLIFIERS", {name: lambda *_: fan for name in SIMPLIFIERS})
    monkeypatch.setattr(subject, "fast_quadric", lambda *_: fan)
    assert made(0) is None
