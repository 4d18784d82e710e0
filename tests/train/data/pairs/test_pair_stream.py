"""Training pairs: coarse meshes that lie beside their surfaces, the same ones for the same seed."""

from functools import cache
from itertools import islice

import numpy as np
import pytest
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.geometry.frames import face_normals
from pns_common.geometry.reference_length import measure_reference_length
from pns_common.refine import refine
from scipy.spatial import cKDTree

from pns_common.mesh import Mesh
from pns_common.schemes import loop
from train.data.pairs.authored import authored_pair
from train.data.pairs.faceted import faceted_pair
from train.data.pairs.grid import grid_pair
from train.data.pairs.lathe import lathe_pair, turned
from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.patch import patch_pair
from train.data.pairs.references import Pair, Reference, moved
from train.data.pairs.solid import solid_pairs
from train.data.pairs.sphere import sphere_pair
from train.data.pairs.swept import swept_pair
from train.metrics.fairness import volume

KINDS = [
    solid_pairs,
    grid_pair,
    sphere_pair,
    faceted_pair,
    patch_pair,
    authored_pair,
    lathe_pair,
    swept_pair,
]

CLOSED = [solid_pairs, sphere_pair, faceted_pair, authored_pair, lathe_pair]


@cache
def drawn(kind):
    """Three pairs of a kind."""
    rng, pairs = np.random.default_rng(3), []
    while len(pairs) < 3:
        if kind is solid_pairs:
            pairs += list(solid_pairs(rng))
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


@pytest.mark.parametrize(
    "kind", [solid_pairs, sphere_pair, faceted_pair, authored_pair, lathe_pair]
)
def test_solids_are_closed(kind):
    for pair in drawn(kind):
        topology = build_topology(pair.coarse.faces, len(pair.coarse.vertices))
        assert (topology.edge_class == EdgeClass.INTERIOR).all()


def test_the_surface_of_authored_meshes_is_loops():
    for pair in drawn(authored_pair):
        expected = refine(pair.coarse, loop(), 5, threads=1).mesh.vertices
        distance, _ = cKDTree(expected).query(pair.surface.points)
        assert distance.max() < 0.03 * np.ptp(expected)
        assert distance[: len(pair.coarse.vertices)].max() < 2e-3 * np.ptp(expected)


def test_authored_meshes_are_quads_cut_in_two():
    """Faces 2 i and 2 i + 1 share an edge, each face with one other."""
    for pair in drawn(authored_pair):
        one, other = pair.coarse.faces[::2], pair.coarse.faces[1::2]
        np.testing.assert_array_equal(one[:, [0, 2]], other[:, :2])


def test_a_turned_outline_is_the_prism_or_cone_that_it_draws():
    """Volumes of n-gons' prisms and pyramids, lids with and without a vertex in the middle."""
    for sides in (3, 8, 17):
        area = sides * np.sin(2 * np.pi / sides) / 2
        for centres in ((True, True), (False, True), (False, False)):
            prism = turned(np.array([[1.0, 0], [1, 3]]), sides, np.array(centres))
            cone = turned(np.array([[1.0, 0], [0, 3]]), sides, np.array([centres[0], True]))
            assert volume(prism) == pytest.approx(3 * area)
            assert volume(cone) == pytest.approx(area)
            assert len(prism.faces) == 4 * sides - 2 * (2 - sum(centres))


def test_the_stream_depends_on_its_seed_alone():
    for a, b in zip(begun(1), islice(pair_stream(1), 4), strict=True):
        assert a.kind == b.kind
        np.testing.assert_array_equal(a.coarse.vertices, b.coarse.vertices)
        np.testing.assert_array_equal(a.surface.points, b.surface.points)
    other = list(islice(pair_stream(2), 2))
    sizes = [[len(pair.coarse.faces) for pair in pairs] for pairs in (begun(1)[:2], other)]
    assert sizes[0] != sizes[1]


def test_the_stream_has_reference_length_one():
    for pair in begun(1):
        assert measure_reference_length(pair.coarse.vertices, pair.coarse.faces) == pytest.approx(1)


def test_moved_pairs_keep_normals_at_right_angles():
    triangle = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    normal = np.ones((3, 3)) / np.sqrt(3)
    turn = 2 * np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned = moved(Pair("any", triangle, Reference(np.eye(3), normal)), turn, np.ones(3))
    (across,) = face_normals(turned.coarse.vertices, turned.coarse.faces)
    np.testing.assert_allclose(turned.surface.normals, np.tile(across, (3, 1)), atol=1e-12)
    np.testing.assert_array_equal(turned.surface.points, turned.coarse.vertices)
