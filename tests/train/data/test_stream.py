"""The stream: of many kinds, the same for the same seed, and without the families held out."""

from itertools import islice

import numpy as np
import pytest
from pns_common.connectivity.topology import EdgeClass, build_topology

from train.data.family_sets import held_out_families, trained_families
from train.data.plane_meshes import regular_grid, scattered, turned_grid
from train.data.stream import FAMILIES, SHARES, crossing, decimated, stream
from train.surfaces.implicit import signed_distance

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
        topology = build_topology(instance.mesh.faces, len(instance.mesh.vertices))
        assert not (topology.edge_class == EdgeClass.IRREGULAR).any()
        assert 60 < len(instance.mesh.faces) < 320


def test_there_are_extraordinary_vertices_and_several_resolutions(instances):
    valences, sizes = set(), set()
    for instance in instances:
        topology = build_topology(instance.mesh.faces, len(instance.mesh.vertices))
        valences |= set(np.bincount(topology.edges.reshape(-1)).tolist())
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
