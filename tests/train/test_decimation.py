"""The decimation test: coarse meshes of dense ones, refined and measured."""

import numpy as np
import pytest
import trimesh

from pns_common import Mesh, load_model, loop, pns
from tests.support.meshes import bent, bumpy_sphere, grid, icosphere
from tests.support.shared import shared_path
from train.baselines.butterfly import modified_butterfly
from train.data.dense_meshes import CAD, DenseMesh, asset_meshes, cad_meshes, is_manifold
from train.data.parts import torus
from train.metrics.decimation import (
    COARSE_FACES,
    NotSimplified,
    Pair,
    Row,
    collapsed,
    compare,
    euler_characteristic,
    gain,
    simplify,
    summaries,
)
from train.metrics.surface_distance import SurfaceErrors
from train.refining import refine

SPHERE = DenseMesh("sphere", CAD, Mesh(*bumpy_sphere(subdivisions=3, bump=0.02)))

COLLAPSED = "train.metrics.decimation.collapsed"


@pytest.fixture(scope="module")
def pair():
    return simplify(SPHERE)


def test_a_large_mesh_comes_down_to_the_count_of_the_source():
    pair = simplify(DenseMesh("torus", CAD, torus()))
    assert len(pair.coarse.faces) == COARSE_FACES
    assert len(pair.coarse.vertices) == 400


def test_a_small_mesh_comes_down_to_a_fifth(pair):
    assert len(pair.coarse.faces) == pytest.approx(1280 / 5, abs=4)


@pytest.mark.parametrize("shape", [icosphere(3), grid(30, bent)], ids=["sphere", "patch"])
def test_the_coarse_mesh_is_a_manifold_of_the_same_kind(shape):
    dense = Mesh(*shape)
    pair = simplify(DenseMesh("it", CAD, dense))
    assert is_manifold(pair.coarse)
    ours, theirs = (
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in (pair.coarse, dense)
    )
    assert ours.euler_number == theirs.euler_number == euler_characteristic(pair.coarse)
    assert ours.is_watertight == theirs.is_watertight
    assert ours.is_winding_consistent


def test_the_coarse_mesh_is_near_the_dense_one(pair):
    size = np.linalg.norm(pair.coarse.vertices, axis=1)
    assert np.abs(size - 1).max() < 0.05


def test_simplification_is_the_same_every_time(pair):
    again = simplify(SPHERE)
    np.testing.assert_array_equal(again.coarse.vertices, pair.coarse.vertices)
    np.testing.assert_array_equal(again.coarse.faces, pair.coarse.faces)


def test_what_hangs_together_by_an_edge_alone_is_cut_off(monkeypatch):
    """Two faces back to back on an edge: what the library leaves of a thin limb."""
    vertices, faces = bumpy_sphere()
    a, b = faces[0][:2]
    tip = len(vertices)
    limbed = np.concatenate([faces, [[a, b, tip], [b, a, tip]]])
    points = np.concatenate([vertices, [[2.0, 2, 2]]])
    assert not is_manifold(Mesh(points, limbed))
    monkeypatch.setattr(
        "train.metrics.decimation.collapsed", lambda mesh, count: Mesh(points, limbed)
    )
    pair = simplify(SPHERE)
    assert pair.cut_off == 2
    assert len(pair.coarse.faces) == len(faces)
    assert len(pair.coarse.vertices) == len(vertices)


def test_where_no_count_gives_a_manifold_alike_there_is_no_pair(monkeypatch):
    counts = []

    def always_open(mesh, count):
        counts.append(count)
        return Mesh(*grid())

    monkeypatch.setattr(COLLAPSED, always_open)
    outcome = simplify(SPHERE)
    assert isinstance(outcome, NotSimplified)
    assert outcome.dense is SPHERE
    assert counts[:5] == [256, 258, 254, 260, 252]
    assert len(set(counts)) == len(counts)


def test_a_large_piece_is_not_cut_off(monkeypatch):
    vertices, faces = icosphere(1)
    two = np.concatenate([faces, faces + len(vertices)])
    points = np.concatenate([vertices, vertices + 5])
    monkeypatch.setattr(COLLAPSED, lambda mesh, count: Mesh(points, two))
    assert isinstance(simplify(SPHERE), NotSimplified)


def test_collapses_leave_no_unused_vertices():
    coarse = collapsed(SPHERE.mesh, 100)
    np.testing.assert_array_equal(np.unique(coarse.faces), np.arange(len(coarse.vertices)))


@pytest.fixture(scope="module")
def rows(pair):
    schemes = {"loop": loop(), "butterfly": modified_butterfly()}
    schemes |= {"no budget": pns(load_model("paper"), 0.0), "paper": pns(load_model("paper"))}
    return compare([pair], schemes, (1, 2), samples=500)


def test_every_method_is_measured_on_every_level(rows):
    assert [(row.method, row.level) for row in rows] == [
        (method, level)
        for method in ("loop", "butterfly", "no budget", "paper")
        for level in (1, 2)
    ]
    assert {row.mesh for row in rows} == {"sphere"}


def test_without_budget_the_operator_is_loop(rows):
    by = {(row.method, row.level): row.errors for row in rows}
    for level in (1, 2):
        assert by["no budget", level] == by["loop", level]
        assert by["paper", level] != by["loop", level]


def test_on_a_sphere_interpolation_is_nearer_than_loop(rows):
    """Loop draws a convex mesh inwards; what keeps its vertices does not."""
    by = {(row.method, row.level): row.errors for row in rows}
    for level in (1, 2):
        assert by["butterfly", level].mean < by["loop", level].mean


def test_a_dense_mesh_that_is_its_own_refinement_has_no_error():
    coarse = Mesh(*bumpy_sphere())
    dense = refine(coarse, loop(), 2).mesh
    (row,) = compare([Pair(DenseMesh("own", CAD, dense), coarse, 0)], {"loop": loop()}, (2,), 500)
    assert row.errors.hausdorff == pytest.approx(0, abs=1e-12)


def test_a_gain_is_the_share_that_the_error_lost():
    percents = gain(SurfaceErrors(1, 2, 4, 8), SurfaceErrors(0.5, 2, 5, 0))
    assert percents == {"mean": 50, "p95": 0, "hausdorff": -25, "normal": 100}


def test_a_summary_is_the_mean_over_meshes_and_names_the_worst():
    def row(mesh, method, mean):
        return Row(mesh, 2, method, SurfaceErrors(mean, 1.0, 1.0, 1.0))

    rows = [row("a", "loop", 1.0), row("a", "ours", 0.5), row("b", "loop", 2.0)]
    rows += [row("b", "ours", 2.1), row("c", "loop", 1.0), row("c", "ours", 1.005)]
    (summary,) = summaries(rows)
    assert (summary.method, summary.level) == ("ours", 2)
    assert summary.percent["mean"] == pytest.approx((50 - 5 - 0.5) / 3)
    assert summary.percent["hausdorff"] == 0
    assert summary.worst == "b"
    assert summary.by_mesh["b"] == pytest.approx(-5)
    assert summary.worse == 1


def test_all_shared_meshes_and_parts_can_be_simplified():
    folder = shared_path("assets")
    dense = [mesh for mesh in asset_meshes(folder) if isinstance(mesh, DenseMesh)] + cad_meshes()
    outcomes = [simplify(mesh) for mesh in dense]
    assert len(outcomes) > 7
    assert all(isinstance(outcome, Pair) and is_manifold(outcome.coarse) for outcome in outcomes)
