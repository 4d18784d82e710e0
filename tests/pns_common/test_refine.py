"""refine: parameters, the report, determinism, and levels that compose."""

import itertools
import json
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pns_common
from pns_common import Mesh, MeshError, ParameterError, load_model, loop, pns, refine
from pns_common.blocks import Blocks, available_threads
from pns_common.progress import LEARNED_COST, LIMIT_COST
from pns_common.refine import measure_reference_length
from pns_common.schemes import Model
from pns_common.topology import build_topology
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid, icosphere, soups, three_pages
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)


@pytest.mark.parametrize("levels", [0, -1, 17, 1.5, "2", True, None])
def test_levels_out_of_range_are_refused(levels):
    with pytest.raises(ParameterError) as caught:
        refine(Mesh(*grid(3)), loop(), levels)
    assert (caught.value.name, caught.value.value) == ("levels", levels)


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan"), float("inf"), "metres", None])
def test_reference_length_out_of_range_is_refused(length):
    with pytest.raises(ParameterError, match="reference_length"):
        refine(Mesh(*grid(3)), loop(), reference_length=length)


@pytest.mark.parametrize("budget", [-0.1, float("nan"), float("inf")])
def test_budget_out_of_range_is_refused(budget):
    with pytest.raises(ParameterError, match="budget"):
        pns(MODEL, budget)


@pytest.mark.parametrize("threads", [0, -1, 1.5])
def test_threads_out_of_range_are_refused(threads):
    with pytest.raises(ParameterError, match="threads"):
        refine(Mesh(*grid(3)), loop(), threads=threads)


def test_a_model_file_keeps_the_model_protocol():
    assert isinstance(MODEL, Model)


def test_default_budget_is_the_models():
    assert pns(MODEL).budget == MODEL.card.budget
    assert pns(MODEL, 0.25).budget == 0.25


def test_coordinates_that_outgrow_the_operator_are_an_error():
    vertices, faces = bumpy_sphere(0, subdivisions=0)
    for budget, levels in [(1e80, 1), (1e308, 1), (1e70, 3)]:
        with pytest.raises(MeshError, match="too large"):
            refine(Mesh(vertices, faces), pns(MODEL, budget), levels)


def test_zero_budget_is_loop():
    mesh = Mesh(*bumpy_sphere())
    refined, base = refine(mesh, pns(MODEL, 0.0), 2), refine(mesh, loop(), 2)
    np.testing.assert_array_equal(refined.mesh.vertices, base.mesh.vertices)
    assert refined.ratio.max() == 0


def test_report_is_json_and_counts_what_was_made():
    vertices, faces = grid(5, bent)
    refined = refine(Mesh(vertices, faces), pns(MODEL), 2)
    report = json.loads(json.dumps(refined.report))
    assert report["scheme"] == "pns"
    assert report["model_hash"] == MODEL.hash
    first, second = report["levels"]
    assert first["faces"] == 4 * len(faces)
    assert second["faces"] == len(refined.mesh.faces)
    assert second["vertices"] == len(refined.mesh.vertices)
    assert first["edges"] == {"interior": 40, "boundary": 16, "irregular": 0}
    edges = len(refined.ratio) - first["vertices"]
    interior = build_topology(
        refine(Mesh(vertices, faces), loop()).mesh.faces, first["vertices"]
    ).interior
    ratio = refined.ratio[first["vertices"] :]
    assert len(ratio) == edges
    assert second["proximity_ratio"]["max"] == ratio[interior].max()
    assert second["proximity_ratio"]["mean"] == pytest.approx(ratio[interior].mean(), rel=1e-12)
    assert second["gate"]["max"] == refined.gate.max()
    assert (refined.ratio[: first["vertices"]] == 0).all()


def test_irregularities_are_counted_not_refused():
    pages = refine(Mesh(*three_pages()), pns(MODEL)).report
    assert pages["levels"][0]["edges"] == {"interior": 0, "boundary": 6, "irregular": 1}
    assert pages["multi_fan_vertices"] == 2
    assert refine(Mesh(*bow_tie()), loop()).report["multi_fan_vertices"] == 1


def slow_normal_jump(vertices, faces):
    topology = build_topology(faces, len(vertices))
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    n1, n2 = (normals[topology.edge_faces[topology.interior, side]] for side in (0, 1))
    sine = np.linalg.norm(np.cross(n1, n2), axis=1)
    return np.arctan2(sine, np.sum(n1 * n2, axis=1)).max()


@pytest.mark.parametrize("shape", [icosphere(1), grid(7, bent), bumpy_sphere(3)])
def test_normal_jump_is_the_largest_angle_across_an_edge(shape):
    refined = refine(Mesh(*shape), pns(MODEL), 2)
    expected = slow_normal_jump(refined.mesh.vertices, refined.mesh.faces)
    reported = refined.report["levels"][-1]["normal_jump_max"]
    assert reported == pytest.approx(expected, rel=1e-9)


def test_summaries_are_the_percentile_and_the_share_that_they_name():
    mesh = Mesh(*bumpy_sphere(1, subdivisions=2))
    refined = refine(mesh, pns(MODEL))
    at_edges = slice(len(mesh.vertices), None)
    ratio, gate = np.sort(refined.ratio[at_edges]), refined.gate[at_edges]
    level = refined.report["levels"][0]
    # All edges are interior. The 99th percentile by hand, between two order statistics.
    place = 0.99 * (len(ratio) - 1)
    below = int(place)
    expected = ratio[below] + (place - below) * (ratio[below + 1] - ratio[below])
    assert level["proximity_ratio"]["p99"] == pytest.approx(expected, rel=1e-12)
    assert level["gate"]["active"] == np.mean(gate > 0.01)
    assert 0 < level["gate"]["active"] < 1
    assert np.mean(gate > 0.5) != level["gate"]["active"]


def test_flipped_faces_are_those_that_oppose_their_loop_counterpart():
    mesh = Mesh(*bumpy_sphere(0, bump=0.4))
    refined, base = refine(mesh, pns(MODEL, 60.0)), refine(mesh, loop())

    def area_vectors(vertices):
        a, b, c = (vertices[refined.mesh.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    opposed = np.sum(area_vectors(refined.mesh.vertices) * area_vectors(base.mesh.vertices), axis=1)
    assert refined.report["levels"][0]["flipped_faces"] == (opposed < 0).sum() > 0
    assert base.report["levels"][0]["flipped_faces"] == 0


@given(soups(), st.integers(1, 2))
def test_a_report_has_no_nan_for_any_mesh(mesh, levels):
    report = refine(mesh, pns(MODEL), levels).report
    json.dumps(report, allow_nan=False)
    for level in report["levels"]:
        assert 0 <= level["proximity_ratio"]["max"] <= 1 + 1e-12
        assert 0 <= level["gate"]["max"] <= 1
        assert 0 <= level["normal_jump_max"] <= np.pi


def test_bits_do_not_depend_on_threads_or_block_size(monkeypatch):
    mesh = Mesh(*bumpy_sphere(0, subdivisions=2))
    expected = refine(mesh, pns(MODEL), 2, threads=1)
    module = sys.modules["pns_common.refine"]
    for threads, rows in [(2, 8192), (3, 300), (1, 77)]:
        monkeypatch.setattr(module, "Blocks", lambda threads, *_, rows=rows: Blocks(threads, rows))
        refined = refine(mesh, pns(MODEL), 2, threads=threads)
        np.testing.assert_array_equal(refined.mesh.vertices, expected.mesh.vertices)
        np.testing.assert_array_equal(refined.ratio, expected.ratio)
        assert refined.report == expected.report


def test_two_calls_with_the_first_ones_length_are_two_levels():
    mesh = Mesh(*bumpy_sphere())
    once = refine(mesh, pns(MODEL))
    length = once.report["reference_length"]
    again = refine(once.mesh, pns(MODEL), reference_length=length)
    both = refine(mesh, pns(MODEL), 2)
    np.testing.assert_array_equal(again.mesh.vertices, both.mesh.vertices)


def test_reference_length_is_one_on_the_papers_patch_and_follows_scale_only():
    vertices, faces = grid(9)
    assert measure_reference_length(vertices, faces) == pytest.approx(1, rel=1e-12)
    assert measure_reference_length(3 * vertices + 5, faces) == pytest.approx(3, rel=1e-12)
    unused = np.concatenate([vertices, [[100.0, 0, 0]]])
    assert measure_reference_length(unused, faces) == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize(
    "scheme", [loop(), pns(MODEL), pns(load_model())], ids=["loop", "all levels", "one level"]
)
@pytest.mark.parametrize("limit", [False, True])
@pytest.mark.parametrize("compiled", [False, True])
def test_progress_moves_inside_every_level_and_ends_at_all_faces(
    scheme, limit, compiled, monkeypatch
):
    """Level by level the faces are known: what is told between their ends is inside a level."""
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "kernels_pay", lambda faces: compiled)
    mesh = Mesh(*grid(11))
    calls = []
    told = lambda done, total: calls.append((done, total))  # noqa: E731
    seen = refine(mesh, scheme, 3, limit=limit, threads=2, progress=told)
    shares = [done / total for done, total in calls]
    assert {total for _, total in calls} == {200 * (4 + 16 + 64)}
    assert shares == sorted(shares)
    assert shares[-1] == 1
    costs = [
        200 * 4**level * (LEARNED_COST if level <= _learned(scheme, 3) else 1)
        for level in range(1, 4)
    ]
    costs += [200 * 64 * LIMIT_COST] * limit
    ends = np.cumsum([0, *costs]) / sum(costs)
    for start, end in itertools.pairwise(ends):
        assert any(start + 1e-3 < share < end - 1e-3 for share in shares), (start, end)
    plain = refine(mesh, scheme, 3, limit=limit)
    np.testing.assert_array_equal(seen.mesh.vertices, plain.mesh.vertices)
    assert seen.report == plain.report


def _learned(scheme, levels):
    return levels if scheme.learned_levels is None else scheme.learned_levels


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("at", [0.1, 0.6, 0.99])
def test_what_progress_raises_ends_the_refinement_before_the_next_block(at, compiled, monkeypatch):
    module = sys.modules["pns_common.refine"]
    monkeypatch.setattr(module, "kernels_pay", lambda faces: compiled)
    calls = []

    def enough(done, total):
        calls.append(done)
        if done >= at * total:
            raise StopRefiningError

    with pytest.raises(StopRefiningError):
        refine(Mesh(*grid(11)), loop(), 3, threads=1, progress=enough)
    assert [done >= at * 200 * 84 for done in calls] == [False] * (len(calls) - 1) + [True]


class StopRefiningError(Exception):
    """Nobody wants it."""


def test_an_error_in_a_block_reaches_the_caller():
    def fail(rows):
        raise ValueError(f"rows {rows.start}")

    with pytest.raises(ValueError, match="rows"):
        Blocks(threads=2, rows=3).run(10, fail)
    assert available_threads() >= 1


@pytest.mark.parametrize("threads", [1, 3])
def test_after_an_error_no_more_blocks_are_begun(threads):
    begun = []

    def refuse(count):
        begun.append(count)
        raise StopRefiningError

    with pytest.raises(StopRefiningError):
        Blocks(threads, 1, refuse).run(10_000, lambda rows: None)
    assert len(begun) <= threads
    begun.clear()
    with pytest.raises(StopRefiningError):
        Blocks(threads, 5, refuse).gather(3, lambda rows: (np.zeros(3),))
    assert begun == [3]


def test_public_names_exist():
    assert all(hasattr(pns_common, name) for name in pns_common.__all__)
