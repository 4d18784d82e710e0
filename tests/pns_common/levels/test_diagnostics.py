"""The measured numbers of a level, each by a slow and obvious formula."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Mesh, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.levels.diagnostics import Reach, edge_counts, limit_distances, reach_of
from pns_common.levels.step import AddedStep
from pns_common.rules.placement import without_correction
from tests.support.meshes import bumpy_sphere, grid
from tests.support.networks import random_model, vertex_model

MODEL = random_model(0, scale=30.0)


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


def test_edges_are_counted_by_class_and_creases_where_there_are_some():
    classes = np.array([0, 1, 0, 2, 1, 0], dtype=np.int8)
    assert edge_counts(classes) == {"interior": 3, "boundary": 2, "irregular": 1}
    assert edge_counts(np.append(classes, np.int8(3)))["crease"] == 1


def test_distances_of_learned_levels_add_up_and_one_without_a_bound_leaves_none():
    first, second = (
        {"displacement_max": moved, "envelope_max": bound}
        for moved, bound in ((1.0, 3.0), (0.5, 1.0))
    )
    assert limit_distances([first, second, {}]) == {
        "learned_levels": 2,
        "limit_distance": 1.5,
        "limit_distance_bound": 4.0,
    }
    assert limit_distances([first, second | {"envelope_max": None}])["limit_distance_bound"] is None


def test_what_creases_keep_back_is_a_distance_of_its_level_and_of_the_limit():
    """At a crease a shift is all that a vertex was moved by: the longer of both counts."""
    levels = [
        {"displacement_max": 0.5, "envelope_max": 2.0, "crease_shift_max": 0.75},
        {"displacement_max": 0.5, "envelope_max": 0.5, "crease_shift_max": 0.625},
        {"crease_shift_max": 0.125},
    ]
    assert limit_distances(levels, limit_shift=0.25) == {
        "learned_levels": 2,
        "limit_distance": 0.75 + 0.625 + 0.125 + 0.25,
        "limit_distance_bound": 2.0 + 0.625 + 0.125 + 0.25,
    }


def test_gates_that_are_shut_are_those_of_both_rules():
    mesh = Mesh(*grid(6, lambda x, y: np.maximum(x, 0) ** 2))
    refined = refine(mesh, pns(vertex_model(0)))
    topology = build_topology(mesh.faces, len(mesh.vertices))
    movable = np.setdiff1d(np.arange(36), topology.edges[topology.edge_class != 0])
    rows = np.concatenate([movable, 36 + topology.interior])
    shut = refined.gate[rows] == 0
    assert 0 < shut[: len(movable)].sum() < len(movable)
    assert refined.report["levels"][0]["shut"] == shut.sum()


@pytest.mark.parametrize("unbound", ["vertices", "edges"])
def test_one_rule_without_a_bound_leaves_a_level_without(unbound):
    nothing = without_correction(np.zeros((1, 3)))
    known = replace(nothing, displacement=np.array([[3.0, 0, 4]]), envelope=np.array([6.0]))
    rules = {"vertices": known, "edges": known, unbound: replace(known, envelope=None)}
    assert reach_of(AddedStep(known, known, True, None)) == Reach(5.0, 6.0)
    assert reach_of(AddedStep(rules["vertices"], rules["edges"], True, None)) == Reach(5.0, None)
