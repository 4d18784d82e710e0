"""The stream of pairs that the default is trained on."""

from functools import cache
from itertools import islice

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pns_common import Mesh
from pns_common.mesh.normals import measure_faces
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.parallel import Blocks
from train.connectivity import connect
from train.data.pairs.faceted import faceted_pair
from train.data.pairs.grid import grid_pair
from train.data.pairs.lathe import PLANS, ears, lathe_pair, polygon, raised, random_lid
from train.data.pairs.machined import machined_pairs
from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.polygons import in_polygons, is_manifold, polygon_stream
from train.data.pairs.references import (
    coarsened,
    patch_pair,
    sphere_pair,
)
from train.data.pairs.solid import solid_pairs
from train.data.primitives import icosphere
from train.metrics.shape import volume
from train.vectors import face_normals

KINDS = [
    solid_pairs,
    machined_pairs,
    grid_pair,
    sphere_pair,
    faceted_pair,
    patch_pair,
    lathe_pair,
]

CLOSED = [solid_pairs, sphere_pair, faceted_pair, machined_pairs, lathe_pair]


@cache
def drawn(kind):
    """Three pairs of a kind."""
    rng, pairs = np.random.default_rng(3), []
    while len(pairs) < 3:
        if kind in (solid_pairs, machined_pairs):
            pairs += list(kind(rng))
        else:
            pair = kind(rng)
            pairs += [] if pair is None else [pair]
    return pairs[:3]


@cache
def begun(seed):
    """The first four pairs of a stream."""
    return list(islice(pair_stream(seed), 4))


@pytest.mark.parametrize("kind", KINDS)
def test_coarse_faces_look_the_way_the_surface_does(kind):
    for pair in drawn(kind):
        normals = face_normals(pair.coarse.vertices, pair.coarse.faces)
        middle = pair.coarse.vertices[pair.coarse.faces].mean(axis=1)
        distance, nearest = cKDTree(pair.surface.points).query(middle)
        agreement = (normals * pair.surface.normals[nearest]).sum(axis=1)
        assert np.median(agreement) > 0.9
        assert np.median(distance) < 0.2 * np.ptp(pair.coarse.vertices)
        np.testing.assert_allclose(np.linalg.norm(pair.surface.normals, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("kind", CLOSED)
def test_solids_are_closed(kind):
    for pair in drawn(kind):
        assert connect(pair.coarse.faces, len(pair.coarse.vertices)).paired.all()


def area(plan, triangles):
    """Of each triangle, negative where it is clockwise."""
    a, b, c = (np.append(plan, [[0.0, 0.0]], axis=0)[triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return (ux * vy - uy * vx) / 2


@pytest.mark.parametrize("draw", PLANS)
def test_a_plan_is_anticlockwise_and_every_lid_covers_it_once(draw):
    rng = np.random.default_rng(1)
    for _ in range(20):
        for plan in draw(rng):
            x, y = plan.T
            whole = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
            assert whole > 0
            triangles = area(plan, random_lid(plan, rng))
            assert triangles.min() > -1e-12
            assert triangles.sum() == pytest.approx(whole)


def test_the_stream_depends_on_its_seed_alone():
    for a, b in zip(begun(1), islice(pair_stream(1), 4), strict=True):
        assert a.kind == b.kind
        np.testing.assert_array_equal(a.coarse.vertices, b.coarse.vertices)
        np.testing.assert_array_equal(a.surface.points, b.surface.points)
    other = list(islice(pair_stream(2), 2))
    sizes = [[len(pair.coarse.faces) for pair in pairs] for pairs in (begun(1)[:2], other)]
    assert sizes[0] != sizes[1]


@cache
def polygons(seed):
    """The first pairs of a stream of polygons."""
    return list(islice(polygon_stream(seed), 8))


def test_polygons_are_mostly_quads_and_lie_on_their_surface_the_way_it_looks():
    degrees = np.concatenate([np.diff(pair.coarse.offsets) for pair in polygons(0)])
    assert (degrees == 4).mean() > 0.6
    for pair in polygons(0):
        mesh = pair.coarse
        assert measure_reference_length(mesh.vertices, mesh.corners) == pytest.approx(1)
        normals, _ = measure_faces(mesh.vertices, mesh.topology(), Blocks(), areas=False)
        middle = np.array([mesh.vertices[face].mean(axis=0) for face in mesh.polygons])
        _, nearest = cKDTree(pair.surface.points).query(middle)
        assert np.median((normals * pair.surface.normals[nearest]).sum(axis=1)) > 0.9


def test_a_stream_of_polygons_depends_on_its_seed_alone():
    for a, b in zip(polygons(0), islice(polygon_stream(0), 8), strict=True):
        np.testing.assert_array_equal(a.coarse.vertices, b.coarse.vertices)
        np.testing.assert_array_equal(a.coarse.corners, b.coarse.corners)


def test_triangles_of_a_drum_are_joined_to_its_quads_and_lids():
    plan = polygon(12)
    drum = raised(np.array([[1.0, 0], [1, 2]]), plan, (ears(plan), ears(plan)))
    seen = set()
    for seed in range(8):
        made = in_polygons(drum, np.random.default_rng(seed))
        degrees = np.bincount(np.diff(made.offsets), minlength=13)
        assert volume(made.triangulated()) == pytest.approx(volume(drum))
        assert is_manifold(made)
        walls = [face for face in made.polygons if np.ptp(made.vertices[face, 2]) > 1]
        assert [len(face) for face in walls] == [4] * 12
        seen.add(int(degrees[12]))
    assert seen == {0, 2}


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
