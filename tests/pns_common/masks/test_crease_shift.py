"""How far creases keep vertices from Loop, held against Loop itself."""

import numpy as np
import pytest

from pns_common import Mesh, crease_lines, load_model, loop, pns, refine
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.masks.crease_shift import crease_shift, limit_crease_shift
from tests.support.meshes import block, bumpy_sphere
from train.data.primitives import box, cylinder

MESHES = {"box": box(), "block": Mesh(*block(3, noise=0.03)), "cylinder": cylinder(16, rows=3)}
GENERAL = pns(load_model())


@pytest.mark.parametrize("name", MESHES)
def test_a_shift_is_the_difference_that_the_creases_make(name):
    mesh, pairs = MESHES[name], crease_lines(MESHES[name])
    topology = with_creases(build_topology(mesh.faces, len(mesh.vertices)), pairs)
    numbers = {tuple(pair): number for number, pair in enumerate(topology.edges.tolist())}
    rows = np.array([numbers[tuple(pair)] for pair in pairs.tolist()])
    with_, without = (refine(mesh, loop(), creases=given).mesh.vertices for given in (pairs, None))
    shift = shift_of(mesh, topology, rows, with_)
    apart = np.linalg.norm(with_ - without, axis=1)
    count = len(mesh.vertices)
    np.testing.assert_allclose(shift.of_vertices, apart[:count][shift.vertices], atol=1e-14)
    np.testing.assert_allclose(shift.of_edges, apart[count:][shift.edges], atol=1e-14)
    elsewhere = np.setdiff1d(np.arange(count), shift.vertices)
    assert not apart[elsewhere].any()
    assert shift.largest == pytest.approx(apart.max(), rel=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_a_limits_shift_is_the_difference_of_the_limits(name):
    mesh, pairs = MESHES[name], crease_lines(MESHES[name])
    creased = refine(mesh, loop(), 1, creases=pairs).mesh
    kept = [tuple(sorted((end, middle))) for end, middle in halves(mesh, pairs)]
    shift = limit_crease_shift(creased.vertices, creased.faces, np.array(kept))
    sharp = refine(mesh, loop(), 1, creases=pairs, limit=True).mesh.vertices
    smooth = refine(creased, loop(), 1, limit=True).mesh.vertices[: len(creased.vertices)]
    apart = np.linalg.norm(sharp - smooth, axis=1)
    np.testing.assert_allclose(shift.of_vertices, apart[shift.vertices], atol=1e-12)
    assert shift.largest == pytest.approx(apart.max(), rel=1e-9)


def shift_of(mesh, topology, rows, placed):
    of_edges = topology.edges, topology.half_edges, topology.edge_class
    return crease_shift(mesh.vertices, mesh.faces, *of_edges, rows, placed)


def halves(mesh, pairs):
    """The halves of creases after one level: their ends and their middles."""
    edges = build_topology(mesh.faces, len(mesh.vertices)).edges.tolist()
    for pair in pairs.tolist():
        middle = len(mesh.vertices) + edges.index(pair)
        yield from ((end, middle) for end in pair)


def test_without_creases_there_is_no_shift():
    nothing = np.zeros(0, dtype=np.int64)
    mesh = box()
    topology = build_topology(mesh.faces, len(mesh.vertices))
    assert shift_of(mesh, topology, nothing, mesh.vertices) is None
    nobody = np.zeros((0, 2), dtype=np.int64)
    assert limit_crease_shift(mesh.vertices, mesh.faces, nobody) is None


@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("name", MESHES)
def test_no_vertex_and_no_limit_is_farther_from_plain_loop_than_the_report_says(
    name, levels, limit
):
    mesh = MESHES[name]
    made = refine(mesh, GENERAL, levels, limit=limit)
    plain = refine(mesh, loop(), levels, limit=limit).mesh.vertices
    stated = made.report["limit_distance"]
    assert np.linalg.norm(made.mesh.vertices - plain, axis=1).max() <= stated
    assert stated <= made.report["limit_distance_bound"]
    # And what Loop makes of the result stays there.
    later = refine(made.mesh, loop(), 1, limit=True).mesh.vertices
    limits = refine(refine(mesh, loop(), levels).mesh, loop(), 1, limit=True).mesh.vertices
    if not limit:
        assert np.linalg.norm(later - limits, axis=1).max() <= stated


@pytest.mark.parametrize(("limit", "share"), [(False, 1.0), (True, 0.7)])
@pytest.mark.parametrize("name", MESHES)
def test_creases_keep_back_as_much_as_the_report_says(name, limit, share):
    mesh, pairs = MESHES[name], crease_lines(MESHES[name])
    made, plain = (refine(mesh, loop(), 1, limit=limit, creases=given) for given in (pairs, None))
    apart = np.linalg.norm(made.mesh.vertices - plain.mesh.vertices, axis=1).max()
    for key in ("limit_distance", "limit_distance_bound"):
        assert share * (1 - 1e-12) <= apart / made.report[key] <= 1 + 1e-12


def test_a_round_mesh_says_nothing_of_creases():
    report = refine(Mesh(*bumpy_sphere()), GENERAL, 2).report
    assert all("crease_shift_max" not in level for level in report["levels"])
