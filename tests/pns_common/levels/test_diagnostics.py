"""The measured numbers of a level, each by a slow and obvious formula."""

import numpy as np
import pytest

from pns_common import Mesh, pns, refine
from pns_common.levels.diagnostics import edge_counts, limit_distances
from tests.support.meshes import bumpy_sphere
from tests.support.networks import random_model

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
